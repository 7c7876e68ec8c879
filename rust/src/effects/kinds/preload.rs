//! Preload: constant forces of a section beside its springs.
//!
//! Source: an assembled structure holds forces of its own (skins, hoses, bellows that were clamped unlike), and fabric or
//! rubber that has crept or sticks holds others after each use. A log that begins at rest tells them by its first pose.
//! Form: force on the mean length and torque on (u, v) = psi (cos phi, sin phi), both constant.
//! Sign: pushes the head away from the base and bends to x or y. Validity: does no net work on a closed path.

use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use crate::real::linear::Vec3;
use std::ops::Range;

/// Constant forces of sections.
#[derive(Clone, Debug)]
pub struct Preload<T> {
    force: Vec3<T>,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for Preload<T> {
    const SUMMARY: &'static str = "constant force along a section and torque on its bending";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("along", "N", -1e4..=1e4, "force on the mean length, positive lengthens").or(0.0),
        Parameter::new("to_x", "N m", -1e3..=1e3, "torque that bends to x, in the section's own frame").or(0.0),
        Parameter::new("to_y", "N m", -1e3..=1e3, "torque that bends to y").or(0.0),
    ];

    fn new(definition: &Definition, values: &[T]) -> Self {
        let force = Vec3([values[1], values[2], values[0]]);
        Self { force, sections: definition.target.sections.clone() }
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        for i in self.sections.clone() {
            now.loads[i].on_arc += self.force;
        }
    }
}
