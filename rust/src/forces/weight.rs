//! Weight. Source: paper (33)-(35): U = -m g.r_S, acting at the centre of mass.

use super::Wrench;
use crate::body::{Body, Section};
use crate::kinematics::chain::Link;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Weight as a wrench.
#[inline(always)]
pub(crate) fn weight<T: Real>(section: &Section<T>, gravity: Vec3<T>, link: &Link<T>) -> Wrench<T> {
    Wrench::at(link.center, gravity * section.mass)
}

/// Potential energy of weight, zero at the base's origin, J.
pub fn gravity_energy<T: Real>(body: &Body<T>, links: &[Link<T>]) -> T {
    body.sections.iter().zip(links).fold(T::zero(), |sum, (s, link)| sum - s.mass * body.gravity.dot(link.center))
}
