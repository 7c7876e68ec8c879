//! A bellows softer or stiffer than its siblings: damage, repair, scatter of manufacture.
//!
//! Source: form of the catalogue, F_spr,j -> (1 + change) F_spr,j, paper (26). Sign: negative is weaker.
//! Acts by changing the arm's parameters. Validity: conservative.

use crate::body::Body;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Relative change of stiffness.
#[derive(Clone, Debug)]
pub struct WeakBellows<T> {
    change: T,
    bellows: Range<usize>,
}

impl<T: Real> Effect<T> for WeakBellows<T> {
    const SUMMARY: &'static str = "a bellows softer or stiffer than stated";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section, PlaceKind::Bellows];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("change", "", -0.95..=5.0, "relative change of the spring force; negative is weaker")];
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { change: values[0], bellows: definition.target.bellows.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        let all = body.sections.iter_mut().flat_map(|s| &mut s.bellows);
        for b in all.skip(self.bellows.start).take(self.bellows.len()) {
            for k in &mut b.stiffness {
                *k *= self.change + 1.0;
            }
        }
    }
}
