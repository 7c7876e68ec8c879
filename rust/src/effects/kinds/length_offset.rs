//! Offset of a length sensor.
//!
//! Form: q + offset is measured. Place: `bellows 32` is the sensor of q32. Acts on measured lengths only, not on the arm.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Offset of length.
#[derive(Clone, Debug)]
pub struct LengthOffset<T> {
    offset: T,
    lengths: Range<usize>,
}

impl<T: Real> Effect<T> for LengthOffset<T> {
    const SUMMARY: &'static str = "offset of a length sensor: q + offset is measured";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] = &[Parameter::new("offset", "m", -0.1..=0.1, "measured less true length")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { offset: values[0], lengths: definition.target.lengths.clone() }
    }

    fn shapes_lengths(&self) -> bool {
        true
    }

    #[inline(always)]
    fn measure(&self, coordinate: usize, length: T) -> T {
        if self.lengths.contains(&coordinate) { length + self.offset } else { length }
    }
}
