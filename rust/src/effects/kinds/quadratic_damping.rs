//! Quadratic damping of a bellows: air pumped through the feed tube, drag of folds.
//!
//! Source: turbulent loss, Delta p ~ v^2 (Idelchik, *Handbook of Hydraulic Resistance*).
//! Form: f = c |q'| q', q the length of the bellows. Sign: f resists, the bellows' force is -f.
//! Validity: passive for c >= 0.

use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Quadratic damping.
#[derive(Clone, Debug)]
pub struct QuadraticDamping<T> {
    damping: T,
    bellows: Range<usize>,
}

impl<T: Real> Effect<T> for QuadraticDamping<T> {
    const SUMMARY: &'static str = "damping of a bellows that grows with the square of its speed";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("damping", "N s^2/m^2", 0.0..=1e5, "coefficient c of f = c |q'| q'")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { damping: values[0], bellows: definition.target.bellows.clone() }
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        for j in self.bellows.clone() {
            let v = now.bellows[j].rate;
            now.bellows_force[j] -= self.damping * v.abs() * v;
        }
    }
}
