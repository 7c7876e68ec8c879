//! Damping of a section's bending.
//!
//! Source: Rayleigh's dissipation function D = 1/2 c (u'^2 + v'^2), (u, v) = psi (cos phi, sin phi); the paper damps the
//! bellows' lengths only, which ties the damping of bending to that of extension.
//! Form: torque -c (u', v') on (u, v). Sign: resists. Validity: passive for c >= 0.

use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::real::Real;
use crate::real::linear::Vec3;
use std::ops::Range;

/// Damping of bending.
#[derive(Clone, Debug)]
pub struct BendingDamping<T> {
    damping: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for BendingDamping<T> {
    const SUMMARY: &'static str = "damping torque on the rate of a section's bending";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("damping", "N m s/rad", 0.0..=100.0, "coefficient c of the torque c d psi/dt")];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { damping: values[0], sections: definition.target.sections.clone() }
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        for i in self.sections.clone() {
            let [du, dv, _] = now.links[i].rate.0;
            now.loads[i].on_arc -= Vec3([self.damping * du, self.damping * dv, T::zero()]);
        }
    }
}
