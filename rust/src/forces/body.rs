//! Weight. Source: paper (33)-(35): U = -m g.r_S, acting at the centre of mass.

use super::Wrench;
use crate::arm::{Arm, Section};
use crate::kinematics::chain::Link;
use crate::linear::Vec3;
use crate::real::Real;

/// Weight as a wrench.
#[inline(always)]
pub(super) fn weight<T: Real>(section: &Section<T>, gravity: Vec3<T>, link: &Link<T>) -> Wrench<T> {
    Wrench::at(link.center, gravity * section.mass)
}

/// Potential energy of weight, zero at the base's origin, J.
pub fn gravity_energy<T: Real>(arm: &Arm<T>, links: &[Link<T>]) -> T {
    arm.sections.iter().zip(links).fold(T::zero(), |sum, (s, link)| sum - s.mass * arm.gravity.dot(link.center))
}
