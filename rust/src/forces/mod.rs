//! The elementary forces on a body, one file each; the one function that sums them, the effects' too, stands above them
//! (`dynamics::applied`).
//!
//! Every force adds to two accumulators per section: a generalized force on (u, v, l), and a wrench on the head body,
//! (torque about the world's origin O, force), in the world. [`project`] turns both into generalized forces.

pub(crate) mod axial;
pub(crate) mod bellows;
pub(crate) mod bending;
pub(crate) mod external;
pub(crate) mod spring;
pub(crate) mod stiffening;
pub(crate) mod weight;

use crate::kinematics::link::Link;
use crate::kinematics::section::Subspace;
use crate::real::Real;
use crate::real::linear::Vec3;

/// A wrench in the world.
#[derive(Clone, Copy, Debug)]
pub struct Wrench<T> {
    /// Torque about the world's origin O, N m.
    pub torque: Vec3<T>,
    /// Force, N.
    pub force: Vec3<T>,
}

impl<T: Real> Wrench<T> {
    /// No wrench.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { torque: Vec3::zero(), force: Vec3::zero() }
    }
    /// The same over another scalar.
    #[inline(always)]
    pub fn lifted(x: &Wrench<f64>) -> Self {
        Self { torque: Vec3::from_f64(x.torque.0), force: Vec3::from_f64(x.force.0) }
    }
    /// A force at a point.
    #[inline(always)]
    pub fn at(point: Vec3<T>, force: Vec3<T>) -> Self {
        Self { torque: point.cross(force), force }
    }
    /// The opposite wrench.
    #[inline(always)]
    pub fn reversed(&self) -> Self {
        Self { torque: -self.torque, force: -self.force }
    }
    /// Adds another wrench.
    #[inline(always)]
    pub fn add(&mut self, other: Self) {
        self.torque += other.torque;
        self.force += other.force;
    }
}

/// What acts on one section.
#[derive(Clone, Copy, Debug)]
pub struct Load<T> {
    /// Generalized force on (u, v, l).
    pub on_arc: Vec3<T>,
    /// Wrench on the head body.
    pub on_head: Wrench<T>,
}

impl<T: Real> Load<T> {
    /// No load.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { on_arc: Vec3::zero(), on_head: Wrench::zero() }
    }
}

/// Which forces to sum: the parts of tau and of N by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ForceSet {
    /// Bellows pressure, paper (25).
    pub actuation: bool,
    /// Bellows springs, paper (26).
    pub spring: bool,
    /// Bellows damping, paper (26), and that of the sections' mean lengths.
    pub damping: bool,
    /// Axial stiffness of the sections.
    pub axial: bool,
    /// Bending stiffness, paper (33)-(35).
    pub bending: bool,
    /// Weight, paper (33)-(35).
    pub gravity: bool,
    /// External forces, paper (28), and wrenches.
    pub external: bool,
    /// Effects that the paper leaves out; those that depend on pressure belong to `actuation`.
    pub effects: bool,
}

impl ForceSet {
    /// Everything.
    pub const ALL: Self = Self {
        actuation: true,
        spring: true,
        damping: true,
        axial: true,
        bending: true,
        gravity: true,
        external: true,
        effects: true,
    };
    /// Everything but the actuation: N.
    pub const PASSIVE: Self = Self { actuation: false, ..Self::ALL };
    /// Nothing, to switch single forces on.
    pub const NONE: Self = Self {
        actuation: false,
        spring: false,
        damping: false,
        axial: false,
        bending: false,
        gravity: false,
        external: false,
        effects: false,
    };
}

/// Generalized forces on (u, v, l) of each section from `loads`: what acts on the arc itself and, by virtual work, the
/// wrenches on this head and all heads above. Works in place on a copy of the running sum only.
#[inline(always)]
pub fn project<T: Real>(links: &[Link<T>], loads: &[Load<T>], mut each: impl FnMut(usize, Vec3<T>)) {
    let mut above = Wrench::zero();
    for i in (0..links.len()).rev() {
        above.add(loads[i].on_head);
        each(i, loads[i].on_arc + on_joint(&links[i], &above));
    }
}

/// Adds a wrench on a body within section `i`, which moves with the section's own rates by the subspace `own`: a force on the
/// section's (u, v, l), and the wrench on the head below.
#[inline(always)]
pub fn act_along<T: Real>(i: usize, own: &Subspace<T>, wrench: Wrench<T>, loads: &mut [Load<T>]) {
    loads[i].on_arc += on_subspace(own, &wrench);
    if i > 0 {
        loads[i - 1].on_head.add(wrench);
    }
}

/// The generalized force of a wrench on one section's (u, v, l), paper (17).
#[inline(always)]
pub fn on_joint<T: Real>(link: &Link<T>, w: &Wrench<T>) -> Vec3<T> {
    on_subspace(&link.subspace, w)
}

/// The same where the motion by (u, v, l) is `s`.
#[inline(always)]
pub fn on_subspace<T: Real>(s: &Subspace<T>, w: &Wrench<T>) -> Vec3<T> {
    Vec3([
        s.angular[0].dot(w.torque) + s.linear[0].dot(w.force),
        s.angular[1].dot(w.torque) + s.linear[1].dot(w.force),
        s.linear[2].dot(w.force),
    ])
}

pub use axial::energy as axial_energy;
pub use bellows::{length, spring_energy, volume};
pub use bending::energy as bending_energy;
pub use external::{External, PointWrench};
pub use weight::gravity_energy;
