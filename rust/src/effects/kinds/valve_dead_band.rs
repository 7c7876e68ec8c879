//! Dead band of a valve or regulator: the pressure follows only beyond a band.
//!
//! Source: play operator (Krasnosel'skii & Pokrovskii, *Systems with Hysteresis*, 1989): p stays while |u - p| <= band and is
//! dragged along at that distance beyond. Hidden: p; at first the pressure that comes in.
//! Update: exact along a monotone input.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Dead band.
#[derive(Clone, Debug)]
pub struct ValveDeadBand<T> {
    band: T,
    inputs: Range<usize>,
}

impl<T: Real> Effect<T> for ValveDeadBand<T> {
    const SUMMARY: &'static str = "pressure follows only beyond a band";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Input];
    const PARAMETERS: &'static [Parameter] = &[Parameter::new("band", "Pa", 0.0..=1e5, "half width of the band")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { band: values[0], inputs: definition.target.inputs.clone() }
    }

    fn shapes_pressures(&self) -> bool {
        true
    }

    fn moved_pressures(&self, moved: &[T], by: &mut [T]) {
        for j in self.inputs.clone() {
            by[j] += self.band * moved[j];
        }
    }

    #[inline(always)]
    fn pressures(&self, _elapsed: T, _from: &[T], last: &[T], p: &mut [T]) {
        for j in self.inputs.clone() {
            p[j] = last[j].max(p[j] - self.band).min(p[j] + self.band);
        }
    }
}
