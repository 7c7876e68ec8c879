//! Torsion: a section twists about its head's z axis under the weight that hangs beside it, and as it stretches.
//!
//! Source: linear torsion, theta = M_z / k, M_z the moment about the head's z axis of the weights of this section and those
//! above it, in the pose without twist; wound bellows turn as they stretch, theta = t (l - l_0), the extension-twist coupling
//! of helices (Love, Mathematical Theory of Elasticity, 1927, art. 271). The paper's section cannot twist.
//! Frame: the head turns by theta about its own z, and everything above with it.
//! Acts on poses of heads only, where they are output; the nine lengths and the dynamics do not see it.
//! Limits: small angles; without the inertia of the twist and without external forces. l_0 is the mean rest length.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Torsional compliance, and twist with length.
#[derive(Clone, Debug)]
pub struct Torsion<T> {
    stiffness: T,
    twist_per_length: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for Torsion<T> {
    const SUMMARY: &'static str = "twist of a section under its load and with its length; seen in poses of heads only";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness", "N m/rad", 0.1..=1e6, "torsional stiffness k of the section").or(1e6),
        Parameter::new("twist_per_length", "rad/m", -200.0..=200.0, "twist t for each metre of stretch").or(0.0),
    ];
    const NEEDS_POSES: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let (stiffness, twist_per_length) = (values[0], values[1]);
        Self { stiffness, twist_per_length, sections: definition.target.sections.clone() }
    }

    fn twist(&self, section: usize, torque: T, stretch: T) -> Option<T> {
        self.sections.contains(&section).then(|| torque / self.stiffness + stretch * self.twist_per_length)
    }
}
