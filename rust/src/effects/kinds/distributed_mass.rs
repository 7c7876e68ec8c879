//! Mass that is spread along a section instead of sitting at its head.
//!
//! Source: the paper lumps a section's mass at its head, (16), and blames the error of Figs. 13 and 14 on that; here a share
//! of it lies evenly on the centre line, as three masses at the nodes of Gauss and Legendre's rule, which integrates
//! polynomials of the fifth degree in the place along the section without error (Abramowitz & Stegun, 25.4.29).
//! Form: mass and moments of the head are those of 1 - s; the share s is discs of the same radius, (J_z / 2, J_z / 2, J_z).
//! Acts by changing the section's masses, after the effects that stand before it in the file.
//! Limits: even spread; a head keeps 5 % of its mass at least.

use crate::body::{Body, PointMass};
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use crate::real::linear::Vec3;
use std::ops::Range;

/// sqrt(3/5) / 2: distance of the outer nodes from the middle.
const NODE: f64 = 0.387_298_334_620_741_7;
/// Places along the section and shares of the mass.
const NODES: [(f64, f64); 3] = [(0.5 - NODE, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + NODE, 5.0 / 18.0)];

/// Spread mass.
#[derive(Clone, Debug)]
pub struct DistributedMass<T> {
    share: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for DistributedMass<T> {
    const SUMMARY: &'static str = "a share of a section's mass lies along it instead of at its head";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::new("share", "", 0.0..=0.95, "s: part of the section's mass that is spread along it")];
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { share: values[0], sections: definition.target.sections.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        let (share, left) = (self.share, T::one() - self.share);
        for section in &mut body.sections[self.sections.clone()] {
            let polar = section.inertia.z() * share;
            let lateral = polar * 0.5;
            for (place, weight) in NODES {
                section.masses.push(PointMass {
                    share: T::from_f64(place),
                    mass: section.mass * share * weight,
                    inertia: Vec3([lateral, lateral, polar]) * T::from_f64(weight),
                    offset: Vec3::zero(),
                });
            }
            section.mass *= left;
            section.inertia = section.inertia * left;
            section.products_of_inertia = section.products_of_inertia.map(|p| p * left);
        }
    }
}
