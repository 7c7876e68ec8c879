//! Rate-independent hysteresis of a bellows: a spring that slips, smoothly (Dahl) or at once (Maxwell slip).
//!
//! Source: Dahl, *A solid friction model*, Aerospace Corp. TOR-0158(3107-18)-1 (1968), which is Bouc-Wen's with n = 1 and
//! gamma = 0 (Ismail, Ikhouane & Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161-188); Iwan, J. Appl. Mech. 33 (1966)
//! 893-900: several that slip at once, side by side, are any hysteresis with Masing's rule (Prandtl-Ishlinskii's stops).
//! Form: f = F w, dw/dq = ((2 - s) / x) min(1, (1 - d w) / (2 (1 - s))), d = sign(q'), -1 <= w <= 1: elastic until
//! d w = 2 s - 1, and from there exponentially towards d. Sharpness s = 0: w' = (q' - |q'| w) / x, Dahl's; s = 1: a spring of
//! stiffness F / x that slips at F. Sign: f resists, the bellows' force is -f.
//! Hidden: w; starts at `start`, 0 where nothing is strained, and is that where an arm rests. Update: exact along a motion
//! that does not turn back (`effects::slip`), second order at turns.
//! Validity: passive for F >= 0 (what is stored, F w^2 / (2 k) with k = dw/dq at w = 0, grows by no more than is put in,
//! since dw/dq falls with d w); the loop's area does not depend on speed.

use crate::effects::slip::{self, Slip};
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Hysteresis.
#[derive(Clone, Debug)]
pub struct Hysteresis<T> {
    force: T,
    slip: Slip<T>,
    start: T,
    bellows: Range<usize>,
}

impl<T: Real> Hysteresis<T> {
    #[inline(always)]
    fn update(&self, now: &Instant<'_, T>, bellows: usize, w: T) -> T {
        let b = &now.bellows[bellows];
        self.slip.after(b.length - b.start_length, w)
    }
}

impl<T: Real> Effect<T> for Hysteresis<T> {
    const SUMMARY: &'static str = "rate-independent hysteresis of a bellows (Dahl, Maxwell slip)";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("amplitude", "N", 0.0..=1e3, "greatest force F"),
        Parameter::new("yield", "m", 1e-6..=1.0, "length x over which the force builds up"),
        Parameter::new("sharpness", "", 0.0..=1.0, "s: 0 slips smoothly (Dahl), 1 at once (Maxwell slip)").or(0.0),
        Parameter::new("start", "", -1.0..=1.0, "w when a simulation starts").or(0.0),
    ];
    const SEVERAL: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let bellows = definition.target.bellows.clone();
        Self { force: values[0], slip: Slip::new(values[1], values[2]), start: values[3], bellows }
    }

    fn hidden(&self) -> usize {
        self.bellows.len()
    }

    fn start(&self, hidden: &mut [T]) {
        hidden.fill(self.start);
    }

    fn moved(&self, moved: &[T], hidden: &mut [T]) {
        slip::moved(hidden, &moved[self.bellows.clone()]);
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, hidden: &[T]) {
        if now.elapsed.is_none() {
            // Where nothing moves it is as strained as it starts: there the arm stands when a simulation begins.
            for j in self.bellows.clone() {
                now.bellows_force[j] -= self.force * self.start;
            }
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
