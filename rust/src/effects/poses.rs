//! Poses of the heads as a camera sees them: with the effects that act on poses only.

use super::Effects;
use crate::body::Body;
use crate::kinematics::chain::{mass_link, pass};
use crate::kinematics::link::{Link, Motion};
use crate::kinematics::section::Pose;
use crate::real::Real;
use crate::real::linear::Mat3;

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

/// Poses of all heads from the links of a pass, in order: what stands on a head that twists twists with it.
pub fn heads<T: Real>(body: &Body<T>, effects: &Effects<T>, links: &[Link<T>], mut each: impl FnMut(Pose<T>)) {
    let mut below = Link::of_base(&body.base);
    let mut seen = Pose { rotation: below.rotation, position: below.position };
    for (i, link) in links.iter().enumerate() {
        // The section by itself, as it is without twist.
        let reach = below.rotation.transposed_mul_vec(link.position - below.position);
        let turn = below.rotation.transposed().mul_mat(&link.rotation);
        let angle = twist(body, effects, i, links);
        seen.position += seen.rotation.mul_vec(reach);
        seen.rotation = seen.rotation.mul_mat(&turn).mul_mat(&about_z(angle));
        each(seen);
        below = *link;
    }
}

/// The angle by which section `i` twists under the weights it carries, and at its length.
fn twist<T: Real>(body: &Body<T>, effects: &Effects<T>, i: usize, links: &[Link<T>]) -> T {
    let mut torque = T::zero();
    let axis = links[i].rotation.column(2);
    let mut add = |mass: T, link: &Link<T>| {
        torque += axis.dot((link.center - links[i].position).cross(body.gravity * mass));
    };
    for (k, (section, link)) in body.sections.iter().zip(links).enumerate().skip(i) {
        add(section.mass, link);
        for mass in &section.masses {
            add(mass.mass, &mass_link(body, links, k, mass, Motion::Pose));
        }
    }
    let bellows = &body.sections[i].bellows;
    let rest = bellows.iter().fold(T::zero(), |sum, b| sum + b.rest_length) / T::from_f64(bellows.len() as f64);
    let stretch = links[i].arc.z() - rest;
    effects.list.iter().filter_map(|e| e.kind.twist(i, torque, stretch)).fold(T::zero(), |sum, a| sum + a)
}

/// Rotation about z by a small angle, orthogonal to rounding: Cayley's form, exact to third order.
fn about_z<T: Real>(angle: T) -> Mat3<T> {
    let (o, i, h) = (T::zero(), T::one(), angle * 0.5);
    let d = (h * h + 1.0).recip();
    let (cos, sin) = ((-(h * h) + 1.0) * d, angle * d);
    Mat3([[cos, -sin, o], [sin, cos, o], [o, o, i]])
}
