//! Offset of one pressure sensor (or of the regulator behind a command).
//!
//! Form: the pressure that acts is p + offset, p the logged (or commanded) one. Sign: positive, more acts than is logged.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Offset of pressure.
#[derive(Clone, Debug)]
pub struct PressureOffset<T> {
    offset: T,
    inputs: Range<usize>,
}

impl<T: Real> Effect<T> for PressureOffset<T> {
    const SUMMARY: &'static str = "offset of a pressure sensor: p + offset acts";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Input];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("offset", "Pa", -1e5..=1e5, "acting less logged pressure")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { offset: values[0], inputs: definition.target.inputs.clone() }
    }

    fn shapes_pressures(&self) -> bool {
        true
    }

    #[inline(always)]
    fn remembers(&self) -> bool {
        false
    }

    #[inline(always)]
    fn pressures(&self, _elapsed: T, _from: &[T], _last: &[T], p: &mut [T]) {
        for j in self.inputs.clone() {
            p[j] += self.offset;
        }
    }

    #[inline(always)]
    fn pressures_at_rest(&self, p: &mut [T]) {
        for j in self.inputs.clone() {
            p[j] += self.offset;
        }
    }
}
