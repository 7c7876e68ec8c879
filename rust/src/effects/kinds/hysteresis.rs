//! Rate-independent hysteresis of a bellows: Dahl's model, which is Bouc-Wen's with n = 1 and gamma = 0.
//!
//! Source: Dahl, *A solid friction model*, Aerospace Corp. TOR-0158(3107-18)-1 (1968); Bouc-Wen: Ismail, Ikhouane & Rodellar,
//! Arch. Comput. Methods Eng. 16 (2009) 161-188. Several with different yields are a smooth Maxwell-slip model.
//! Form: f = F w, w' = (q' - |q'| w) / x, -1 <= w <= 1. Sign: f resists, the bellows' force is -f.
//! Hidden: w; at rest 0. Update: exact along a motion that does not turn back (`effects::slip`), second order at turns.
//! Validity: passive for F >= 0; the loop's area does not depend on speed.

use crate::effects::slip::slip;
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Dahl hysteresis.
#[derive(Clone, Debug)]
pub struct Hysteresis<T> {
    force: T,
    inverse_yield: T,
    bellows: Range<usize>,
}

impl<T: Real> Hysteresis<T> {
    #[inline(always)]
    fn update(&self, now: &Instant<'_, T>, bellows: usize, w: T) -> T {
        let b = &now.bellows[bellows];
        slip(w, b.length - b.start_length, T::one(), self.inverse_yield)
    }
}

impl<T: Real> Effect<T> for Hysteresis<T> {
    const SUMMARY: &'static str = "rate-independent hysteresis of a bellows (Dahl)";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("amplitude", "N", 0.0..=1e3, "greatest force F"),
        Parameter::new("yield", "m", 1e-6..=1.0, "length x over which the force builds up"),
    ];
    const SEVERAL: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { force: values[0], inverse_yield: values[1].recip(), bellows: definition.target.bellows.clone() }
    }

    fn hidden(&self) -> usize {
        self.bellows.len()
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, hidden: &[T]) {
        if now.elapsed.is_none() {
            return;
        }
        for (w, j) in hidden.iter().zip(self.bellows.clone()) {
            now.bellows_force[j] -= self.force * self.update(now, j, *w);
        }
    }

    #[inline(always)]
    fn advance(&self, now: &Instant<'_, T>, hidden: &mut [T]) {
        for (w, j) in hidden.iter_mut().zip(self.bellows.clone()) {
            *w = self.update(now, j, *w);
        }
    }
}
