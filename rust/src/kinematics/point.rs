//! Pose and Jacobian of any point of the arm, and its shape.
//!
//! Source: paper (12), (14) for a point at a fraction of a section's length; a part of an arc is an arc, (u, v, l) scaled
//! by that part.
//! Frame: that of the chain. Jacobian rows: velocity of the point, then angular velocity, per unit rate of each length.

use super::arcs;
use super::chain::pass;
use super::coordinates::force_on_lengths;
use super::link::{Link, Motion};
use super::section::{Bent, Pose, Subspace};
use crate::body::Body;
use crate::real::Real;
use crate::real::linear::{Mat3, Vec3};

/// A point of the arm: `fraction` of the way along the arc of `section` (1: the head, its rigid piece included), moved
/// by `offset` in the frame there.
#[derive(Clone, Copy, Debug)]
pub struct Point<T> {
    /// Section index from 0.
    pub section: usize,
    /// 0 (start of the arc) to 1 (head).
    pub fraction: f64,
    /// Offset in the local frame, m.
    pub offset: Vec3<T>,
}

/// The link on which section `i` stands.
fn below<T: Real>(body: &Body<T>, links: &[Link<T>], i: usize) -> Link<T> {
    if i == 0 { Link::of_base(&body.base) } else { links[i - 1] }
}

/// The point's section up to the point, in its base frame: pose and motion subspace by the section's (u, v, l).
fn part<T: Real>(body: &Body<T>, links: &[Link<T>], point: &Point<T>) -> (Pose<T>, Subspace<T>) {
    let (section, arc) = (&body.sections[point.section], links[point.section].arc);
    let f = T::from_f64(point.fraction);
    let head = point.fraction >= 1.0;
    if section.arcs.is_empty() {
        let head_offset = if head { section.head_offset } else { T::zero() };
        let bent = Bent::new(arc * f, section.base_offset, head_offset);
        return (bent.pose(), bent.subspace().scaled(Vec3([f; 3])));
    }
    let local = arcs::local(section, arc, Vec3::zero(), (!head).then_some(f), Motion::Pose);
    (local.pose, local.subspace)
}

/// Orientation and position of a point. `links` must hold a pass.
pub fn pose<T: Real>(body: &Body<T>, links: &[Link<T>], point: &Point<T>) -> (Mat3<T>, Vec3<T>) {
    let below = below(body, links, point.section);
    let (local, _) = part(body, links, point);
    let rotation = below.rotation.mul_mat(&local.rotation);
    let position = below.position + below.rotation.mul_vec(local.position) + rotation.mul_vec(point.offset);
    (rotation, position)
}

/// Position of a point and the motion subspace, about O, by which its own section moves it; none at a head, which moves by that
/// of its link.
pub fn motion<T: Real>(body: &Body<T>, links: &[Link<T>], point: &Point<T>) -> (Vec3<T>, Option<Subspace<T>>) {
    let (rotation, position) = pose(body, links, point);
    if point.fraction >= 1.0 {
        return (position, None);
    }
    let below = below(body, links, point.section);
    let (_, local) = part(body, links, point);
    let origin = position - rotation.mul_vec(point.offset);
    let angular = local.angular.map(|v| below.rotation.mul_vec(v));
    let [u, v, l] = local.linear.map(|v| below.rotation.mul_vec(v));
    (position, Some(Subspace { angular, linear: [u + origin.cross(angular[0]), v + origin.cross(angular[1]), l] }))
}

/// The Jacobian of a point by the lengths, column by column: (velocity, angular velocity). Columns of sections above
/// are zero. `columns` has one entry a coordinate.
pub fn jacobian<T: Real>(body: &Body<T>, links: &[Link<T>], point: &Point<T>, columns: &mut [[Vec3<T>; 2]]) {
    let (rotation, position) = pose(body, links, point);
    for (i, section) in body.sections.iter().enumerate() {
        // Rows of the Jacobian by (u, v, l) transform to the lengths like generalized forces.
        let (angular, linear) = if i < point.section {
            let s = &links[i].subspace;
            let e = [s.angular[0], s.angular[1], Vec3::zero()];
            (e, [0, 1, 2].map(|k| s.linear[k] + e[k].cross(position)))
        } else if i == point.section {
            let below = below(body, links, i);
            let (_, local) = part(body, links, point);
            let arm_of_point = rotation.mul_vec(point.offset);
            let turned = |v: Vec3<T>| below.rotation.mul_vec(v);
            let e = [turned(local.angular[0]), turned(local.angular[1]), Vec3::zero()];
            (e, [0, 1, 2].map(|k| turned(local.linear[k]) + e[k].cross(arm_of_point)))
        } else {
            ([Vec3::zero(); 3], [Vec3::zero(); 3])
        };
        for row in 0..3 {
            let pick = |v: &[Vec3<T>; 3]| {
                force_on_lengths(Vec3([v[0].0[row], v[1].0[row], v[2].0[row]]), section.inverse_radius)
            };
            let (lin, ang) = (pick(&linear), pick(&angular));
            for k in 0..3 {
                columns[3 * i + k][0].0[row] = lin.0[k];
                columns[3 * i + k][1].0[row] = ang.0[k];
            }
        }
    }
}

/// Points along the whole arm from the base, `per_section` on each arc and the ends of the rigid pieces.
pub fn shape(body: &Body<f64>, q: &[f64], per_section: usize, links: &mut [Link<f64>], out: &mut Vec<Vec3<f64>>) {
    pass(body, q, &[], Motion::Pose, links);
    out.clear();
    out.push(body.base.position);
    for section in 0..body.sections.len() {
        for k in 0..=per_section {
            // The last point of the arc, before the rigid piece, is a hair below fraction 1.
            let fraction = (k as f64 / per_section as f64).min(1.0 - f64::EPSILON);
            out.push(pose(body, links, &Point { section, fraction, offset: Vec3::zero() }).1);
        }
        out.push(links[section].position);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::{arms, states};
    use crate::real::Dual;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn jacobian_is_the_derivative_of_the_pose(arm in arms(), seed in states(), fraction in 0.0..=1.0_f64, which in 0..5_usize) {
            let q = seed.lengths(&arm);
            let section = which % arm.body.sections.len();
            let offset = Vec3([0.02, -0.01, 0.03]);
            let mut links = vec![Link::base(); arm.body.sections.len()];
            pass(&arm.body, &q, &[], Motion::Pose, &mut links);
            let mut columns = vec![[Vec3::zero(); 2]; arm.coordinates()];
            jacobian(&arm.body, &links, &Point { section, fraction, offset }, &mut columns);
            let lifted = arm.lift::<Dual<1>>();
            for (j, column) in columns.iter().enumerate() {
                let dual: Vec<_> = q.iter().enumerate().map(|(k, &x)| Dual::<1>::variable(x, usize::from(k != j))).collect();
                let mut links = vec![Link::base(); arm.body.sections.len()];
                pass(&lifted.body, &dual, &[], Motion::Pose, &mut links);
                let point = Point { section, fraction, offset: Vec3::from_f64(offset.0) };
                let (rotation, position) = pose(&lifted.body, &links, &point);
                let turn = Mat3::cross_matrix(column[1]);
                for a in 0..3 {
                    prop_assert!((position.0[a].derivative[0] - column[0].0[a]).abs() < 1e-11);
                    for b in 0..3 {
                        let expected: f64 = (0..3).map(|c| turn.0[a][c] * rotation.0[c][b].value).sum();
                        prop_assert!((rotation.0[a][b].derivative[0] - expected).abs() < 1e-10);
                    }
                }
            }
        }
    }
}
