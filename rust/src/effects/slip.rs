//! The updates of hysteresis and friction: a spring that slips.
//!
//! Source: Dahl 1968; w' = (q' - |q'| w / g) / x with -1 <= w / g <= 1. Along a motion that does not turn back, w obeys
//! dw/dq = (1 - sign(q') w / g) / x whatever the speed, so w = s g + (w_0 - s g) exp(-|q - q_0| / (g x)), s = sign(q - q_0),
//! is exact; a turn between the two points costs an error of second order in the step.

use crate::real::Real;

/// w after a motion by `travel` from `w`; it tends to `limit` times the sign of the motion over distances `reach`.
#[inline(always)]
pub fn slip<T: Real>(w: T, travel: T, limit: T, inverse_reach: T) -> T {
    let end = T::select(travel, limit, -limit);
    end + (w - end) * (-(travel.abs() * inverse_reach)).exp()
}

/// Moves each w of some bellows, -1 to 1, by where it stands in a run that begins in a motion ([`super::Effect::moved`]).
pub fn moved<T: Real>(w: &mut [T], by: &[T]) {
    for (w, by) in w.iter_mut().zip(by) {
        *w = (*w + *by).max(-T::one()).min(T::one());
    }
}

/// A spring that is elastic over part of its range and slips beyond: see [`crate::effects::kinds::hysteresis`].
#[derive(Clone, Copy, Debug)]
pub struct Slip<T> {
    /// dw/dq while it is elastic, 1/m.
    elastic: T,
    /// Up to which w, in the direction of motion.
    until: T,
    /// Rate of the exponential beyond, 1/m.
    beyond: T,
}

impl<T: Real> Slip<T> {
    /// With its yield and its sharpness, from 0 to 1.
    pub fn new(reach: T, sharpness: T) -> Self {
        let elastic = (-sharpness + 2.0) / reach;
        let smooth = ((-sharpness + 1.0) * 2.0).max(T::from_f64(1e-9));
        Self { elastic, until: sharpness * 2.0 - 1.0, beyond: elastic / smooth }
    }

    /// w after a motion by `travel` from `w`, exact where the motion does not turn back.
    #[inline(always)]
    pub fn after(&self, travel: T, w: T) -> T {
        let direction = T::select(travel, T::one(), -T::one());
        let (w, travel) = (w * direction, travel.abs());
        let left = ((self.until - w) / self.elastic).max(T::zero());
        // A motion within what is left is elastic; of a longer one the rest slips.
        let rest = travel - left;
        let elastic = w + travel * self.elastic;
        let from = w.max(self.until);
        let slipping = T::one() - (T::one() - from) * (-(rest.max(T::zero()) * self.beyond)).exp();
        T::select(rest, slipping, elastic) * direction
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_dahl_to_a_stop() {
        for (w, travel) in [(0.0, 0.004), (0.7, -0.003), (-1.0, 0.05), (0.3, 0.0), (-0.2, -1e-5), (0.9, 0.02)] {
            let dahl = Slip::new(0.01, 0.0).after(travel, w);
            assert!((dahl - slip(w, travel, 1.0, 100.0)).abs() < 1e-15, "{w} {travel}: {dahl}");
            let stop: f64 = Slip::new(0.01, 1.0).after(travel, w);
            assert!((stop - (w + travel / 0.01).clamp(-1.0, 1.0)).abs() < 1e-15, "{w} {travel}: {stop}");
        }
    }

    #[test]
    fn between_them_it_follows_its_equation() {
        // dw/dq by small steps, to the end of the motion and back.
        for sharpness in [0.0, 0.25, 0.5, 0.9] {
            let made = Slip::new(0.01, sharpness);
            let slope =
                |d: f64, w: f64| (2.0 - sharpness) / 0.01 * 1.0_f64.min((1.0 - d * w) / (2.0 * (1.0 - sharpness)));
            for (start, travel) in [(0.0, 0.03), (0.8, -0.025), (-0.95, 0.006)] {
                let (n, d, mut w) = (20_000, f64::signum(travel), start);
                let h = f64::abs(travel) / f64::from(n);
                for _ in 0..n {
                    let half = w + 0.5 * h * d * slope(d, w);
                    w += h * d * slope(d, half);
                }
                let exact: f64 = made.after(travel, start);
                assert!((exact - w).abs() < 1e-7, "{sharpness} {start} {travel}: {exact} {w}");
                // In two parts as in one.
                let parts = made.after(0.6 * travel, made.after(0.4 * travel, start));
                assert!((parts - exact).abs() < 1e-12);
            }
        }
    }
}
