//! Cubic and quintic part of the bending moment: a section that stiffens, or softens, as it bends.
//!
//! Source: paper (33)-(35), Fig. 9, fits a line; the form of the catalogue is M_bend = k1 psi + k3 psi^3 + k5 psi^5, the odd
//! powers that a law of fabric or rubber, which grows as an exponential (Fung 1967), is of over the bends of an arm.
//! Form: k3 and k5 are added to those of the section. Sign: positive stiffens. Acts by changing the arm's parameters.
//! Validity: conservative; where k1 + 3 k3 psi^2 + 5 k5 psi^4 falls below zero, the moment turns round.

use crate::body::Body;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Bending stiffness that changes with the bend.
#[derive(Clone, Debug)]
pub struct BendingNonlinear<T> {
    cubic_stiffness: T,
    quintic_stiffness: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for BendingNonlinear<T> {
    const SUMMARY: &'static str = "cubic and quintic part of the bending moment";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new(
            "cubic_stiffness",
            "N m/rad^3",
            -1e3..=1e3,
            "k3 of M_bend = k1 psi + k3 psi^3 + k5 psi^5, added",
        ),
        Parameter::new("quintic_stiffness", "N m/rad^5", -1e3..=1e3, "k5 of the same, added").or(0.0),
    ];
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let [cubic_stiffness, quintic_stiffness] = [values[0], values[1]];
        Self { cubic_stiffness, quintic_stiffness, sections: definition.target.sections.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        for section in &mut body.sections[self.sections.clone()] {
            section.bending_stiffness[1] += self.cubic_stiffness;
            section.bending_stiffness[2] += self.quintic_stiffness;
        }
    }
}
