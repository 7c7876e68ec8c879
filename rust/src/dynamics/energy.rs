//! Energies: kinetic (translational, rotational) and potential by name.
//!
//! Source: paper (16), (33), (36)-(39), with U_bend as the integral of the bending moment; the springs' energy is the
//! integral of (26)'s spring force over each bellows' own length. With `end_force` the springs' work on the arm is not the
//! change of this energy (`docs/explanation/model.md`).

use super::Workspace;
use super::recursion::{body_tensor, mass_tensor};
use crate::arm::Arm;
use crate::forces::{axial_energy, bending_energy, gravity_energy, length, spring_energy};
use crate::kinematics::chain::{pass, pass_masses};
use crate::kinematics::link::{Link, Motion};
use crate::real::Real;
use crate::real::linear::Sym3;

/// Energies of an arm, J.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy<T = f64> {
    /// Translational kinetic energy of the lumped masses, those along the sections included.
    pub translational: T,
    /// Rotational kinetic energy; zero where the arm leaves it out.
    pub rotational: T,
    /// Potential of the weight, zero at the world's origin.
    pub gravity: T,
    /// Energy of bending.
    pub bending: T,
    /// Energy in the bellows' springs.
    pub spring: T,
    /// Energy in what holds the sections' mean lengths beside them.
    pub axial: T,
}

impl<T: Real> Energy<T> {
    /// Kinetic energy T.
    pub fn kinetic(&self) -> T {
        self.translational + self.rotational
    }
    /// Potential energy, springs included.
    pub fn potential(&self) -> T {
        self.gravity + self.bending + self.spring + self.axial
    }
    /// Adds the kinetic energy of a body of mass `m`.
    fn add_motion(&mut self, m: T, link: &Link<T>, tensor: &Sym3<T>) {
        let (v, w) = (link.center_velocity(), link.angular_velocity);
        self.translational += m * v.dot(v) * 0.5;
        self.rotational += w.dot(tensor.mul_vec(w)) * 0.5;
    }
    /// Sum of all.
    pub fn total(&self) -> T {
        self.kinetic() + self.potential()
    }
}

/// The energies at a state.
pub fn energy<T: Real>(arm: &Arm<T>, q: &[T], qd: &[T], ws: &mut Workspace<T>) -> Energy<T> {
    pass(&arm.body, q, qd, Motion::Velocity, &mut ws.links);
    let zero = T::zero();
    pass_masses(&arm.body, &ws.links, 0, Motion::Velocity, &mut ws.masses);
    let gravity = gravity_energy(&arm.body, &ws.links, &ws.masses);
    let mut e = Energy { translational: zero, rotational: zero, gravity, bending: zero, spring: zero, axial: zero };
    for (section, link) in arm.body.sections.iter().zip(&ws.links) {
        e.add_motion(section.mass, link, &body_tensor(arm, section, link));
        e.bending += bending_energy(section, link.arc);
        if let Some(axial) = &section.axial {
            e.axial += axial_energy(axial, link.arc);
        }
        for b in &section.bellows {
            e.spring += spring_energy(b, length(b, link.arc));
        }
    }
    for (mass, link) in arm.body.sections.iter().flat_map(|s| &s.masses).zip(&ws.masses) {
        e.add_motion(mass.mass, link, &mass_tensor(arm, mass, link));
    }
    e
}
