//! Gain error of a length sensor.
//!
//! Form: (1 + gain) q is measured. Place: `bellows 32` is the sensor of q32. Acts on measured lengths only, not on the arm.
//! Gains and offsets act in the order of the file.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Gain of length.
#[derive(Clone, Debug)]
pub struct LengthGain<T> {
    gain: T,
    lengths: Range<usize>,
}

impl<T: Real> Effect<T> for LengthGain<T> {
    const SUMMARY: &'static str = "gain error of a length sensor: (1 + gain) q is measured";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("gain", "", -0.5..=0.5, "relative excess of measured over true length")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { gain: values[0], lengths: definition.target.lengths.clone() }
    }

    fn shapes_lengths(&self) -> bool {
        true
    }

    #[inline(always)]
    fn measure(&self, coordinate: usize, length: T) -> T {
        if self.lengths.contains(&coordinate) { length * (self.gain + 1.0) } else { length }
    }
}
