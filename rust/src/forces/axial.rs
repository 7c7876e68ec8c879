//! Axial stiffness and damping of a section: what a sleeve or a backbone does to its mean length l.
//!
//! Source: none in the paper, whose sections are held by their bellows alone. Springs at the bellows' radius r tie
//! lengthening to bending, 3 k to 1.5 k r^2; fabric arms hardly lengthen and bend easily.
//! Form: F = -F_axial(l - l_0) - d l', F_axial a polynomial as that of the bellows. Sign: resists. It works on l alone,
//! whichever the force model: an axial force has no lever.

use super::{Load, spring};
use crate::body::Axial;
use crate::kinematics::link::Link;
use crate::real::linear::Vec3;
use crate::real::{Real, kernel};

kernel! {
    /// Adds the spring and the damper, or one of them, to a section's load. Out of line: sections that have none run past
    /// a call.
    pub(crate) fn add<'a, T>(
        axial: &'a Axial<T>,
        which: (bool, bool),
        link: &'a Link<T>,
        load: &'a mut Load<T>,
    ) {
        let (stiff, damped) = which;
        let mut force = T::zero();
        if stiff {
            force -= spring::force(&axial.stiffness[..axial.stiffness_terms], link.arc.z() - axial.rest_length);
        }
        if damped {
            force = axial.damping.neg_mul_add(link.rate.z(), force);
        }
        load.on_arc += Vec3([T::zero(), T::zero(), force]);
    }
}

/// Energy of the spring, J.
pub fn energy<T: Real>(axial: &Axial<T>, arc: Vec3<T>) -> T {
    spring::energy(&axial.stiffness[..axial.stiffness_terms], arc.z() - axial.rest_length)
}
