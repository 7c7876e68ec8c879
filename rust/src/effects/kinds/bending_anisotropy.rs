//! Bending stiffness that is greater in one plane: paired chambers, a rib, a seam, a hose along the arm.
//!
//! Source: paper (33) writes M_bend(psi, phi) and identifies one plane; linear bending of a beam with two principal
//! stiffnesses. Form: U = 1/2 k (u cos alpha + v sin alpha)^2 is added, (u, v) = psi (cos phi, sin phi): k in the plane
//! phi = alpha, nothing at right angles to it. Sign: positive stiffens. Acts by changing the arm's parameters.
//! Validity: conservative; never below the section's own stiffness for k >= 0.

use crate::body::{BendingPlanes, Body};
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::kinematics::arc::ArcFunctions;
use crate::real::Real;
use std::ops::Range;

/// Stiffness in one plane.
#[derive(Clone, Debug)]
pub struct BendingAnisotropy<T> {
    stiffness: T,
    angle: T,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for BendingAnisotropy<T> {
    const SUMMARY: &'static str = "bending stiffness that is greater in one plane";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness", "N m/rad", 0.0..=1e3, "stiffness k that is added in the plane"),
        Parameter::new("angle", "rad", -3.2..=3.2, "angle alpha of the plane about z, from x"),
    ];
    const SEVERAL: bool = true;
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { stiffness: values[0], angle: values[1], sections: definition.target.sections.clone() }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        let double = self.angle * 2.0;
        let f = ArcFunctions::new(double * double);
        let half = self.stiffness * 0.5;
        for section in &mut body.sections[self.sections.clone()] {
            section.bending_stiffness[0] += half;
            let planes = section.bending_planes.get_or_insert_with(|| Box::new(BendingPlanes::alike()));
            planes.linear[0] += half * f.cos();
            planes.linear[1] += half * double * f.a();
        }
    }
}
