//! Poses of the heads as a camera sees them: with the effects that act on poses only.

use super::Effects;
use crate::body::Body;
use crate::kinematics::chain::{Link, Motion, pass};
use crate::kinematics::section::{Bent, Pose};
use crate::real::Real;
use crate::real::linear::{Mat3, Vec3};

/// Whether some of an arm's effects act on poses.
pub fn acts<T: Real>(effects: &Effects<T>) -> bool {
    effects.list.iter().any(|e| e.info().needs_poses)
}

/// Poses of all heads at lengths `q` as a camera sees them, in order; `links` is work space, one a section.
#[inline(always)]
pub fn seen<T: Real>(
    body: &Body<T>,
    effects: &Effects<T>,
    q: &[T],
    links: &mut [Link<T>],
    mut each: impl FnMut(usize, Pose<T>),
) {
    pass(body, q, &[], Motion::Pose, links);
    if acts(effects) {
        let mut section = 0;
        heads(body, effects, links, |head| {
            each(section, head);
            section += 1;
        });
    } else {
        for (section, link) in links.iter().enumerate() {
            each(section, Pose { rotation: link.rotation, position: link.position });
        }
    }
}

/// Poses of all heads from the links of a pass, in order.
pub fn heads<T: Real>(body: &Body<T>, effects: &Effects<T>, links: &[Link<T>], mut each: impl FnMut(Pose<T>)) {
    let mut below = Pose { rotation: Mat3::identity(), position: Vec3::zero() };
    for (i, link) in links.iter().enumerate() {
        let local = local(body, effects, i, link.arc);
        let untwisted = below.rotation.mul_mat(&local.rotation);
        below.position += below.rotation.mul_vec(local.position);
        let angle = twist(body, effects, i, links);
        below.rotation = untwisted.mul_mat(&about_z(angle));
        each(below);
    }
}

/// The pose of section `i` in its base's frame, its halves bent differently where an effect says so.
fn local<T: Real>(body: &Body<T>, effects: &Effects<T>, i: usize, arc: Vec3<T>) -> Pose<T> {
    let section = &body.sections[i];
    let mut asymmetry: Option<T> = None;
    for entry in &effects.list {
        if let Some(c) = entry.kind.bend(i) {
            asymmetry = Some(asymmetry.map_or(c, |sum| sum + c));
        }
    }
    let Some(c) = asymmetry else {
        return Bent::new(arc, section.base_offset, section.head_offset).pose();
    };
    let [u, v, l] = (arc * T::from_f64(0.5)).0;
    let half = |share: T, base: T, head: T| Bent::new(Vec3([u * share, v * share, l]), base, head).pose();
    let lower = half(c + 1.0, section.base_offset, T::zero());
    let upper = half(-c + 1.0, T::zero(), section.head_offset);
    Pose {
        rotation: lower.rotation.mul_mat(&upper.rotation),
        position: lower.position + lower.rotation.mul_vec(upper.position),
    }
}

/// The angle by which section `i` twists under the weights it carries.
fn twist<T: Real>(body: &Body<T>, effects: &Effects<T>, i: usize, links: &[Link<T>]) -> T {
    let mut torque = T::zero();
    let axis = links[i].rotation.column(2);
    for (section, link) in body.sections.iter().zip(links).skip(i) {
        torque += axis.dot((link.center - links[i].position).cross(body.gravity * section.mass));
    }
    effects.list.iter().filter_map(|e| e.kind.twist(i, torque)).fold(T::zero(), |sum, a| sum + a)
}

/// Rotation about z by a small angle, orthogonal to rounding: Cayley's form, exact to third order.
fn about_z<T: Real>(angle: T) -> Mat3<T> {
    let (o, i, h) = (T::zero(), T::one(), angle * 0.5);
    let d = (h * h + 1.0).recip();
    let (cos, sin) = ((-(h * h) + 1.0) * d, angle * d);
    Mat3([[cos, -sin, o], [sin, cos, o], [o, o, i]])
}
