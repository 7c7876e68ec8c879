//! Curvature that grows or falls along a section, as in a conical one.
//!
//! Source: paper (6), (8) with its remarks on variable curvature and on the piecewise constant curvature of conical sections
//! (Mahl, Hildebrandt & Sawodny, IEEE T-RO 30(4), 2014, 935-949).
//! Form: the curvature is that of the section times 1 + c (1 - 2 s), s from 0 at its base to 1 at its head; its length and the
//! angle of the whole section stay. In arcs of constant curvature with the means of their parts: those of the section, or
//! [`ARCS`] equal ones where it is one arc. Acts by changing the section's arcs: on motion and on what is seen.
//! Limits: within four arcs the direction is off by less than |c| psi / 64 from that of the straight law. Radius and area of
//! the bellows stay as they are.

use crate::body::{Body, SectionArc};
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use std::ops::Range;

/// Arcs of a section that was one.
const ARCS: usize = 4;

/// Uneven curvature.
#[derive(Clone, Debug)]
pub struct Taper<T> {
    change: T,
    sections: Range<usize>,
}

impl<T: Real> Taper<T> {
    /// The arcs of section `i`, with their shares of bending times the means of the law.
    fn arcs(&self, body: &Body<T>, i: usize) -> Vec<SectionArc<T>> {
        let own = &body.sections[i].arcs;
        let equal = T::from_f64(1.0 / ARCS as f64);
        let one = T::one();
        let quarter = SectionArc { length: equal, bending: equal, relative_radius: one, relative_area: one };
        let mut arcs = if own.len() < 2 { vec![quarter; ARCS] } else { own.clone() };
        let mut start = T::zero();
        for arc in &mut arcs {
            let ends = start + start + arc.length;
            arc.bending *= one + self.change * (one - ends);
            start += arc.length;
        }
        arcs
    }
}

impl<T: Real> Effect<T> for Taper<T> {
    const SUMMARY: &'static str = "curvature that falls (or, negative, grows) along a section";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[Parameter::new(
        "change",
        "",
        -0.95..=0.95,
        "c: curvature times 1 + c at the section's base, 1 - c at its head",
    )];
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { change: values[0], sections: definition.target.sections.clone() }
    }

    fn objection(values: &[f64], definition: &Definition, body: &Body<f64>) -> Option<String> {
        let taper = Taper::new(definition, values);
        taper.sections.clone().find_map(|i| {
            let arcs = taper.arcs(body, i);
            let sum = |of: fn(&SectionArc<f64>) -> f64| arcs.iter().map(of).sum::<f64>();
            let least = sum(|a| a.bending).min(sum(|a| a.bending * a.relative_radius));
            (least < 0.05).then(|| {
                format!("the arcs of section {} bend against each other so much that nothing would be left", i + 1)
            })
        })
    }

    fn change_arm(&self, body: &mut Body<T>) {
        for i in self.sections.clone() {
            let arcs = self.arcs(body, i);
            body.set_arcs(i, arcs);
        }
    }
}
