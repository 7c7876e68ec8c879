//! Terminal area that changes with pressure or length: thin walls balloon, folds turn.
//!
//! Source: bellows practice (effective area, EJMA standards); form of the catalogue, A = A_P (1 + a (p - p_amb) + b (q - q_rest)).
//! Form: extra actuation force A_P (a (p - p_amb) + b (q - q_rest)) (p - p_amb). Sign: as pressure, pushes the ends apart.
//! Place in the equations: part of tau, which is then no longer linear in p: `actuation_matrix` is its slope at ambient
//! pressure. The chamber's volume follows ([`crate::pneumatics`]), so that air that is shut in keeps its energy; for that
//! the body is told of the change. Validity: first order in both.

use crate::body::{AreaChange, Body};
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Area by pressure and length.
#[derive(Clone, Debug)]
pub struct EffectiveArea<T> {
    by_pressure: T,
    by_length: T,
    bellows: Range<usize>,
}

impl<T: Real> Effect<T> for EffectiveArea<T> {
    const SUMMARY: &'static str = "terminal area that changes with pressure or length";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("by_pressure", "1/Pa", -1e-5..=1e-5, "relative change of area per pressure above ambient")
            .or(0.0),
        Parameter::new("by_length", "1/m", -50.0..=50.0, "relative change of area per length above rest").or(0.0),
    ];

    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { by_pressure: values[0], by_length: values[1], bellows: definition.target.bellows.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        let none = AreaChange { by_pressure: T::zero(), by_length: T::zero() };
        let count = body.sections.iter().map(|s| s.bellows.len()).sum();
        body.area_changes.resize(count, none);
        for change in &mut body.area_changes[self.bellows.clone()] {
            change.by_pressure += self.by_pressure;
            change.by_length += self.by_length;
        }
    }

    #[inline(always)]
    fn is_actuation(&self) -> bool {
        true
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        let all = now.body.sections.iter().flat_map(|s| &s.bellows).enumerate();
        for (j, b) in all.skip(self.bellows.start).take(self.bellows.len()) {
            let state = &now.bellows[j];
            let change = self.by_pressure * state.pressure + self.by_length * (state.length - b.rest_length);
            now.bellows_force[j] += b.terminal_area * change * state.pressure;
        }
    }
}
