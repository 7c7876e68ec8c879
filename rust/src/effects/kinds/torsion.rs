//! Quasi-static torsion: a section twists about its head's z axis under the weight that hangs beside it.
//!
//! Source: linear torsion, theta = M_z / k, M_z the moment about the head's z axis of the weights of this section and those
//! above it, in the pose without twist. The paper's section cannot twist.
//! Frame: the head turns by theta about its own z, and everything above with it.
//! Acts on poses of heads only, where they are output; the nine lengths and the dynamics do not see it.
//! Limits: small angles; without the inertia of the twist and without external forces.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Torsional compliance.
#[derive(Clone, Debug)]
pub struct Torsion<T> {
    stiffness: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for Torsion<T> {
    const SUMMARY: &'static str = "quasi-static twist of a section under its load; seen in poses of heads only";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("stiffness", "N m/rad", 0.1..=1e6, "torsional stiffness k of the section")];
    const NEEDS_POSES: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { stiffness: values[0], sections: definition.target.sections.clone() }
    }

    fn twist(&self, section: usize, torque: T) -> Option<T> {
        self.sections.contains(&section).then(|| torque / self.stiffness)
    }
}
