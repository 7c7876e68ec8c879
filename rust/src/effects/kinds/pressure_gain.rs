//! Gain error of one pressure sensor (or of the regulator behind a command).
//!
//! Form: the pressure that acts, above ambient, is (1 + gain) times the logged (or commanded) one above ambient: sensors and
//! regulators are zeroed in the open air, so their gain turns about ambient pressure. Sign: positive, more acts.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Gain of pressure.
#[derive(Clone, Debug)]
pub struct PressureGain<T> {
    gain: T,
    ambient: f64,
    inputs: Range<usize>,
}

impl<T: Real> Effect<T> for PressureGain<T> {
    const SUMMARY: &'static str = "gain error of a pressure sensor: (1 + gain) times the pressure above ambient acts";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Input];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("gain", "", -0.9..=2.0, "relative excess of acting over logged pressure, both above ambient")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { gain: values[0], ambient: definition.ambient_pressure, inputs: definition.target.inputs.clone() }
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
            p[j] += (p[j] - self.ambient) * self.gain;
        }
    }

    #[inline(always)]
    fn pressures_at_rest(&self, p: &mut [T]) {
        for j in self.inputs.clone() {
            p[j] += (p[j] - self.ambient) * self.gain;
        }
    }
}
