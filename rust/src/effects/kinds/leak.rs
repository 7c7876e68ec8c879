//! A leak: what flows out through a hole has to come through the tube, and pressure falls along it.
//!
//! Source: flow through an orifice goes with the square root of the pressure across it (ISO 6358 below choking), flow
//! through a tube with the first power (Hagen-Poiseuille); Beater, *Pneumatic Drives* (2007), ch. 3 and 4.
//! Form: u - p = D sign(p - p_amb) sqrt(|p - p_amb| / 1 bar), p the pressure in the chamber and u the logged (or commanded) one
//! in front of the tube; D is what is lost at 1 bar above ambient. Below ambient air flows in. A hole that is as laminar as
//! the tube is a `pressure_gain` below zero, so there is no kind for that.
//! Behind `level = "full"` it acts on the air that arrives, as what remembers does, for air flows only where a valve feeds it.
//! Limits: steady flow; a pressure that is logged in the chamber has the leak in it already, and shows none.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// 1 bar, Pa.
const BAR: f64 = 1e5;

/// Leak.
#[derive(Clone, Debug)]
pub struct Leak<T> {
    /// D / sqrt(1 bar).
    loss: T,
    ambient: f64,
    inputs: Range<usize>,
}

impl<T: Real> Effect<T> for Leak<T> {
    const SUMMARY: &'static str = "leak behind the tube: less pressure arrives, by the root of what is above ambient";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Input];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("drop", "Pa", 0.0..=1e5, "fall of pressure D along the tube at 1 bar above ambient")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        let inputs = definition.target.inputs.clone();
        Self { loss: values[0] * BAR.sqrt().recip(), ambient: definition.ambient_pressure, inputs }
    }

    fn shapes_pressures(&self) -> bool {
        true
    }

    #[inline(always)]
    fn pressures(&self, _elapsed: T, _from: &[T], _last: &[T], p: &mut [T]) {
        self.pressures_at_rest(p);
    }

    #[inline(always)]
    fn pressures_at_rest(&self, p: &mut [T]) {
        for j in self.inputs.clone() {
            // r^2 + loss r = y for r the root of what is left of y above ambient: r = 2 y / (loss + sqrt(loss^2 + 4 y)).
            let above = p[j] - self.ambient;
            let y = above.abs();
            let root = y * 2.0 / (self.loss + (self.loss * self.loss + y * 4.0 + f64::MIN_POSITIVE).sqrt());
            p[j] = T::select(above, root * root, -(root * root)) + self.ambient;
        }
    }
}
