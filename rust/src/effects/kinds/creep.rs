//! Creep: a viscoelastic branch beside a bellows' spring, a spring and a damper in series (standard linear solid).
//!
//! Source: Ferry, *Viscoelastic Properties of Polymers*, 3rd ed., ch. 1 (generalized Maxwell model, one element); paper
//! section IV-D names creep. Two branches (a Prony series) are two effects.
//! Form: f = k z, z' = q' - z / tau, with q the length of the bellows. Sign: f resists, the bellows' force is -f.
//! Hidden: z, m; starts at `strain`, 0 where the material has rested: not so where the arm was moved shortly before. Update: exact for a length that is cubic in time between the step's start and the stage
//! (values and rates at both ends), so the error is of fourth order in the step however short tau is.
//! Validity: linear; passive for k >= 0.

use crate::effects::exponential::phi;
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Extension of the branch's spring by which one of [`Effect::moved`] counts, m: a usual stroke.
const STRAINED: f64 = 0.02;

/// A viscoelastic branch.
#[derive(Clone, Debug)]
pub struct Creep<T> {
    stiffness: T,
    tau: T,
    strain: T,
    bellows: Range<usize>,
}

impl<T: Real> Creep<T> {
    /// z at the instant from that at the step's start, `each(bellows, z)`.
    #[inline(always)]
    fn update(&self, now: &Instant<'_, T>, start: impl Fn(usize) -> T, mut each: impl FnMut(usize, T)) {
        let Some(h) = now.elapsed else { return };
        let [f0, f1, f2, f3] = phi(self.tau.recip() * h);
        for (slot, j) in self.bellows.clone().enumerate() {
            let b = &now.bellows[j];
            let (v0, v1) = (b.start_rate * h, b.rate * h);
            let travel = b.length - b.start_length;
            // h q'(s) = v0 + c1 s + c2 s^2 over s in [0, 1], the cubic through both ends.
            let c1 = travel * 6.0 - v0 * 4.0 - v1 * 2.0;
            let c2 = (v0 + v1) * 3.0 - travel * 6.0;
            each(slot, start(slot) * f0 + v0 * f1 + c1 * f2 + c2 * f3 * 2.0);
        }
    }
}

impl<T: Real> Effect<T> for Creep<T> {
    const SUMMARY: &'static str = "viscoelastic branch on a bellows";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness", "N/m", 0.0..=1e6, "stiffness k of the branch"),
        Parameter::new("tau", "s", 1e-4..=1e6, "relaxation time"),
        Parameter::new("strain", "m", -1.0..=1.0, "extension z of the branch's spring when a simulation starts")
            .or(0.0),
    ];
    const SEVERAL: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let bellows = definition.target.bellows.clone();
        Self { stiffness: values[0], tau: values[1], strain: values[2], bellows }
    }

    fn hidden(&self) -> usize {
        self.bellows.len()
    }

    fn start(&self, hidden: &mut [T]) {
        hidden.fill(self.strain);
    }

    fn moved(&self, moved: &[T], hidden: &mut [T]) {
        for (z, j) in hidden.iter_mut().zip(self.bellows.clone()) {
            *z += moved[j] * STRAINED;
        }
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, hidden: &[T]) {
        let force = std::mem::take(&mut now.bellows_force);
        self.update(now, |k| hidden[k], |k, z| force[self.bellows.start + k] -= self.stiffness * z);
        now.bellows_force = force;
    }

    #[inline(always)]
    fn advance(&self, now: &Instant<'_, T>, hidden: &mut [T]) {
        let cells = std::cell::Cell::from_mut(hidden).as_slice_of_cells();
        self.update(now, |k| cells[k].get(), |k, z| cells[k].set(z));
    }
}
