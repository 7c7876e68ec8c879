//! Cubic part of the bending moment.
//!
//! Source: paper (33)-(35), Fig. 9, fits a line; the form of the catalogue is M_bend = k1 psi + k3 psi^3.
//! Form: k3 is added to that of the section. Sign: positive stiffens. Acts by changing the arm's parameters.
//! Validity: conservative; with a negative k3 the moment turns round at psi = sqrt(-k1 / (3 k3)).

use crate::body::Body;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Cubic bending stiffness.
#[derive(Clone, Debug)]
pub struct BendingNonlinear<T> {
    cubic_stiffness: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for BendingNonlinear<T> {
    const SUMMARY: &'static str = "cubic part of the bending moment";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("cubic_stiffness", "N m/rad^3", -1e3..=1e3, "k3 of M_bend = k1 psi + k3 psi^3, added")];
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { cubic_stiffness: values[0], sections: definition.target.sections.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        for section in &mut body.sections[self.sections.clone()] {
            section.bending_stiffness[1] += self.cubic_stiffness;
        }
    }
}
