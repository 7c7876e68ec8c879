//! Curvature that is not constant along a section: its two halves bend differently.
//!
//! Source: variable curvature as in Mahl, Hildebrandt & Sawodny, IEEE T-RO 30(4) (2014) 935-949, reduced to two arcs.
//! Form: the lower half bends with (1 + c) of the section's curvature, the upper half with (1 - c); the angle of the whole
//! section stays, so the head's orientation does, and its position moves.
//! Acts on positions of heads only, where they are output; the lengths and the dynamics do not see it.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Uneven curvature.
#[derive(Clone, Debug)]
pub struct NonConstantCurvature<T> {
    asymmetry: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for NonConstantCurvature<T> {
    const SUMMARY: &'static str = "the two halves of a section bend differently; seen in positions of heads only";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("asymmetry", "", -0.95..=0.95, "c: the lower half bends with 1 + c of the curvature")];
    const NEEDS_POSES: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { asymmetry: values[0], sections: definition.target.sections.clone() }
    }

    fn bend(&self, section: usize) -> Option<T> {
        self.sections.contains(&section).then_some(self.asymmetry)
    }
}
