//! Dry friction along a bellows: LuGre's presliding with Stribeck's curve, without its two viscous terms.
//!
//! Source: Canudas de Wit, Olsson, Astrom & Lischinsky, IEEE Trans. Autom. Control 40(3) (1995) 419-425; the curve is that
//! of Hess & Soom, ASME J. Tribology 112 (1990) 147-152, 1 / (1 + (v / v_s)^2), in place of a Gaussian, which costs more.
//! Form: f = F w, w' = (q' - |q'| w / g) / x with g = 1 + (r - 1) / (1 + (q' / v_s)^2): at speed f tends to F sign(q'), near
//! rest to r F. Sign: f resists, the bellows' force is -f. Viscous friction is the bellows' damping.
//! Hidden: w; at rest 0. Update: exact for constant speed, else of second order (`effects::slip`), g at the mean speed.
//! Validity: passive. At r = 1 it is Dahl's law, which `hysteresis` is at larger lengths: here x is tenths of millimetres.

use crate::effects::slip::{self, slip};
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// LuGre friction.
#[derive(Clone, Debug)]
pub struct Friction<T> {
    force: T,
    inverse_presliding: T,
    excess: T,
    inverse_stribeck: T,
    bellows: Range<usize>,
}

impl<T: Real> Friction<T> {
    #[inline(always)]
    fn update(&self, now: &Instant<'_, T>, bellows: usize, w: T) -> T {
        let b = &now.bellows[bellows];
        let v = (b.start_rate + b.rate) * self.inverse_stribeck * 0.5;
        let g = T::one() + self.excess / (v * v + 1.0);
        slip(w, b.length - b.start_length, g, self.inverse_presliding / g)
    }
}

impl<T: Real> Effect<T> for Friction<T> {
    const SUMMARY: &'static str = "dry friction along a bellows (LuGre, Stribeck)";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("coulomb_force", "N", 0.0..=1e3, "Coulomb friction F, at speed"),
        Parameter::new("presliding", "m", 1e-6..=0.01, "length x over which the force builds up").or(2e-4),
        Parameter::new("static_ratio", "", 1.0..=5.0, "breakaway force over Coulomb friction, r").or(1.0),
        Parameter::new("stribeck_velocity", "m/s", 1e-5..=10.0, "speed v_s of Stribeck's curve").or(0.01),
    ];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self {
            force: values[0],
            inverse_presliding: values[1].recip(),
            excess: values[2] - 1.0,
            inverse_stribeck: values[3].recip(),
            bellows: definition.target.bellows.clone(),
        }
    }

    fn hidden(&self) -> usize {
        self.bellows.len()
    }

    fn moved(&self, moved: &[T], hidden: &mut [T]) {
        slip::moved(hidden, &moved[self.bellows.clone()]);
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
