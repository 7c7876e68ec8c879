//! Chambers that fill from one supply share what it can give: what one of them takes, the others lack.
//!
//! Source: tubes of one resistance behind a common restriction, linear, as reduced models of pneumatic lines have them
//! (Beater, *Pneumatic Drives* (2007), ch. 3).
//! Form: p_j' = max(u_j - p_j - D, 0) / tau where u_j > p_j, else (u_j - p_j) / tau, with the fall of pressure along the
//! restriction D = k sum_j max(u_j - p_j - D, 0); k is its resistance over that of one tube. Venting needs no supply. With k = 0 it
//! is a `pressure_lag` of tau.
//! Hidden: p; at first the pressures that come in. Update: exponential towards straight lines, of second order in the
//! distance of samples or steps over tau.
//! Limits: chambers count alike, whatever their volumes; a regulator lets no air back into the supply.

use crate::effects::exponential::phi;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Sag of the supply.
#[derive(Clone, Debug)]
pub struct SupplySag<T> {
    share: T,
    tau: T,
    inputs: Range<usize>,
}

/// Rounds in which it is found which chambers fill: each leaves out those whose want is below the sag so far.
const ROUNDS: usize = 4;

impl<T: Real> SupplySag<T> {
    /// D, for chambers at `p` under `u`.
    #[inline(always)]
    fn sag(&self, u: &[T], p: &[T]) -> T {
        let mut sag = T::zero();
        for _ in 0..ROUNDS {
            let (mut wanted, mut filling) = (T::zero(), T::one());
            for j in self.inputs.clone() {
                let more = T::select(u[j] - p[j] - sag, T::one(), T::zero());
                wanted += more * (u[j] - p[j]);
                filling += more * self.share;
            }
            sag = self.share * wanted / filling;
        }
        sag
    }

    /// Where a chamber at `p` goes under `u` with the sag `sag`.
    #[inline(always)]
    fn end(u: T, p: T, sag: T) -> T {
        T::select(u - p, (u - sag).max(p), u)
    }
}

impl<T: Real> Effect<T> for SupplySag<T> {
    const SUMMARY: &'static str = "chambers that fill from one supply share what it can give";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("share", "", 0.0..=100.0, "resistance k of the common way over that of one chamber's"),
        Parameter::new("tau", "s", 1e-4..=100.0, "time constant of one chamber alone, with a supply that does not sag"),
    ];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { share: values[0], tau: values[1], inputs: definition.target.inputs.clone() }
    }

    fn shapes_pressures(&self) -> bool {
        true
    }

    #[inline(always)]
    fn pressures(&self, elapsed: T, from: &[T], last: &[T], p: &mut [T]) {
        let h = T::select(elapsed, elapsed, T::one());
        let [keep, mean, ..] = phi(h / self.tau);
        // Towards the straight line from where it goes at the start of the piece to where it would at the end.
        let follow = |at: T, first: T, second: T| {
            let slope = second - first;
            second + (at - first) * keep - slope * mean
        };
        let before = self.sag(from, last);
        // No heap and no limit on inputs: what comes in is kept in `p`, so that what comes out is found twice.
        let mut wanted = T::zero();
        let mut filling = T::one();
        for j in self.inputs.clone() {
            let first = Self::end(from[j], last[j], before);
            let about = follow(last[j], first, Self::end(p[j], last[j], before));
            let more = T::select(p[j] - about - before, T::one(), T::zero());
            wanted += more * (p[j] - about);
            filling += more * self.share;
        }
        let after = self.share * wanted / filling;
        for j in self.inputs.clone() {
            let first = Self::end(from[j], last[j], before);
            let about = follow(last[j], first, Self::end(p[j], last[j], before));
            let out = follow(last[j], first, Self::end(p[j], about, after));
            p[j] = T::select(elapsed, out, last[j]);
        }
    }
}
