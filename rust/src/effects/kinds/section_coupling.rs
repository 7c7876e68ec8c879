//! Coupling of the bending of neighbouring sections: shared plates, an outer skin, hoses that run through.
//!
//! Source: effects of parallel structures, U = 1/2 k |(u, v)_i - (u, v)_{i+1}|^2, D likewise with the damping.
//! Form: torque -k ((u, v)_i - (u, v)_{i+1}) on section i and its opposite on section i + 1. Place: `section i` couples
//! sections i and i + 1; `all` couples all neighbours. Validity: passive for k, c >= 0.

use crate::body::Body;
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use crate::real::linear::Vec3;
use std::ops::Range;

/// Coupling of neighbouring sections.
#[derive(Clone, Debug)]
pub struct SectionCoupling<T> {
    stiffness: T,
    damping: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for SectionCoupling<T> {
    const SUMMARY: &'static str = "spring between the bending of a section and the next";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness", "N m/rad", -1e4..=1e4, "stiffness k between the bending angles"),
        Parameter::new("damping", "N m s/rad", 0.0..=1e4, "damping between their rates").or(0.0),
    ];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { stiffness: values[0], damping: values[1], sections: definition.target.sections.clone() }
    }

    fn objection(_values: &[f64], definition: &Definition, body: &Body<f64>) -> Option<String> {
        let count = body.sections.len();
        let last = definition.target.sections.start + 1 == count;
        last.then(|| format!("section {count} is the last one; a section with one above it is needed"))
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        let pairs = self.sections.end.min(now.links.len() - 1);
        for i in self.sections.start..pairs {
            let (a, b) = (&now.links[i], &now.links[i + 1]);
            let difference = (a.arc - b.arc) * self.stiffness + (a.rate - b.rate) * self.damping;
            let torque = Vec3([difference.x(), difference.y(), T::zero()]);
            now.loads[i].on_arc -= torque;
            now.loads[i + 1].on_arc += torque;
        }
    }
}
