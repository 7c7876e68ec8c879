//! Chamber pressure behind the logged (or commanded) one, filling and venting with their own time constants.
//!
//! Source: first order with the chamber's resistance and capacity, as reduced models of pneumatic lines have it; paper section
//! IV takes its pneumatic model from elsewhere.
//! Form: p' = (u - p) / tau, tau = fill where u > p, else vent. Hidden: p; at first the pressure that comes in.
//! Update: exact along a straight piece of u, its change from filling to venting (or back) included. Several lags are stages in series, in
//! the order of the file: tube and chamber.
//! Behind `level = "full"`: a tube between valve and bellows. It is the air that arrives late; what is in the bellows is
//! compressed at once, so that with valves closed a lag of any length changes nothing ([`crate::effects::pressures`]).

use crate::effects::exponential::phi;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// How far behind one of [`Effect::moved_pressures`] is, Pa.
const BEHIND: f64 = 5e4;

/// First-order lag.
#[derive(Clone, Debug)]
pub struct PressureLag<T> {
    fill: T,
    vent: T,
    inputs: Range<usize>,
}

impl<T> PressureLag<T> {
    /// Of all of so many inputs, with these time constants, s.
    pub fn of_all(fill: T, vent: T, inputs: usize) -> Self {
        Self { fill, vent, inputs: 0..inputs }
    }
}

/// u - p after `h` seconds of a lag `tau`, from `e`, with u rising at `slope`.
#[inline(always)]
fn decay<T: Real>(e: T, slope: T, tau: T, h: T) -> T {
    let [f0, f1, _, _] = phi(h / tau);
    e * f0 + slope * h * f1
}

impl<T: Real> PressureLag<T> {
    /// p after the input has gone from `from` to `to` in a straight line.
    #[inline(always)]
    fn follow(&self, h: T, from: T, to: T, p: T) -> T {
        let (e, slope) = (from - p, (to - from) / h);
        // Where u and p meet within the piece, they do so after tau ln(1 + y), y = -e / (slope tau): before that the one
        // time constant holds, after it the other. The logarithm's Pade form (2, 1) is good to 1e-4 for y < 0.5, and where it is not,
        // u - p is near zero and tau matters little.
        let rising = T::select(e, T::one(), T::select(-e, T::zero(), T::select(slope, T::one(), T::zero())));
        let before = T::select(rising, self.fill, self.vent);
        let after = T::select(rising, self.vent, self.fill);
        let apart = -(e * slope);
        let y = T::select(apart, -e / (T::select(apart, slope, T::one()) * before), T::from_f64(1e9));
        let meeting = before * (y * (y + 6.0) / (y * 4.0 + 6.0));
        let meets = h - meeting;
        let whole = decay(e, slope, before, h);
        let rest = decay(T::zero(), slope, after, meets.max(T::zero()));
        to - T::select(meets, rest, whole)
    }
}

impl<T: Real> Effect<T> for PressureLag<T> {
    const SUMMARY: &'static str = "acting pressure lags behind, with time constants for filling and venting";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Input];
    const SEVERAL: bool = true;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("fill", "s", 1e-4..=100.0, "time constant while the pressure rises"),
        Parameter::new("vent", "s", 1e-4..=100.0, "time constant while it falls"),
    ];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { fill: values[0], vent: values[1], inputs: definition.target.inputs.clone() }
    }

    fn shapes_pressures(&self) -> bool {
        true
    }

    fn moved_pressures(&self, moved: &[T], by: &mut [T]) {
        for j in self.inputs.clone() {
            by[j] += moved[j] * BEHIND;
        }
    }

    #[inline(always)]
    fn pressures(&self, elapsed: T, from: &[T], last: &[T], p: &mut [T]) {
        if elapsed.largest() <= 0.0 {
            p[self.inputs.clone()].copy_from_slice(&last[self.inputs.clone()]);
            return;
        }
        let h = T::select(elapsed, elapsed, T::one());
        for j in self.inputs.clone() {
            p[j] = T::select(elapsed, self.follow(h, from[j], p[j], last[j]), last[j]);
        }
    }
}
