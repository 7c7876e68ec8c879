//! Weight. Source: paper (33)-(35): U = -m g.r_S, acting at the centre of mass.

use super::Wrench;
use crate::body::Body;
use crate::kinematics::link::Link;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Weight of a body of mass `m` as a wrench.
#[inline(always)]
pub(crate) fn weight<T: Real>(m: T, gravity: Vec3<T>, link: &Link<T>) -> Wrench<T> {
    Wrench::at(link.center, gravity * m)
}

/// Potential energy of weight, zero at the world's origin, J.
pub fn gravity_energy<T: Real>(body: &Body<T>, links: &[Link<T>], masses: &[Link<T>]) -> T {
    let heads = body.sections.iter().map(|s| s.mass).zip(links);
    let along = body.sections.iter().flat_map(|s| &s.masses).map(|m| m.mass).zip(masses);
    heads.chain(along).fold(T::zero(), |sum, (mass, link)| sum - mass * body.gravity.dot(link.center))
}
