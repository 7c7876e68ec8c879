//! A mass at a head, or a mass distributed otherwise than assumed.
//!
//! Source: parallel axes (Steiner): two bodies of masses m, dm whose centres are apart by d have together the inertia of
//! both about their own centres and (m dm / (m + dm)) (|d|^2 1 - d d^T).
//! Frame: the offset is given in the head's frame. Sign: a positive mass is added; a negative one means that the section's
//! mass sits elsewhere or is less than assumed. Acts by changing the section's mass, centre of mass and inertia.
//! Limits: a point mass; where the arm leaves rotational energy out, (58), both masses move as one at their common centre.

use crate::body::Body;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::real::Real;
use crate::real::linear::{Sym3, Vec3};

/// A point mass.
#[derive(Clone, Debug)]
pub struct Payload<T> {
    mass: T,
    offset: Vec3<T>,
    section: usize,
}

impl<T: Real> Payload<T> {
    /// Mass, centre of mass and inertia (moments, products) of the section with the payload.
    fn combined(&self, body: &Body<T>) -> (T, Vec3<T>, Sym3<T>) {
        let s = &body.sections[self.section];
        let mass = s.mass + self.mass;
        let share = self.mass / mass;
        let apart = self.offset - s.center_of_mass;
        let own = Sym3::from_moments_and_products(s.inertia, s.products_of_inertia.unwrap_or(Vec3::zero()));
        (mass, s.center_of_mass + apart * share, own.add(&Sym3::of_point_mass(s.mass * share, apart)))
    }
}

impl<T: Real> Effect<T> for Payload<T> {
    const SUMMARY: &'static str = "mass at a head; negative: less mass than assumed, or elsewhere";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("mass", "kg", -10.0..=10.0, "mass added"),
        Parameter::new("x", "m", -1.0..=1.0, "its place in the head's frame").or(0.0),
        Parameter::new("y", "m", -1.0..=1.0, "its place in the head's frame").or(0.0),
        Parameter::new("z", "m", -1.0..=1.0, "its place in the head's frame").or(0.0),
    ];
    const SEVERAL: bool = true;
    const CHANGES_ARM: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let offset = Vec3([values[1], values[2], values[3]]);
        Self { mass: values[0], offset, section: definition.target.sections.start }
    }

    fn objection(values: &[f64], definition: &Definition, body: &Body<f64>) -> Option<String> {
        let payload = Payload::new(definition, values);
        let own = body.sections[payload.section].mass;
        if own + payload.mass <= 0.0 {
            return Some(format!("the section's mass is {own} kg; what is taken away must be less"));
        }
        let (_, _, Sym3([xx, xy, xz, yy, yz, zz])) = payload.combined(body);
        let minor = xx * yy - xy * xy;
        let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
        let fine = payload.mass >= 0.0 || (xx >= 0.0 && minor >= 0.0 && determinant >= 0.0);
        (!fine).then(|| {
            "the section's moments of inertia would become negative; take away less mass, or nearer".to_owned()
        })
    }

    fn change_arm(&self, body: &mut Body<T>) {
        let (mass, center, Sym3([xx, xy, xz, yy, yz, zz])) = self.combined(body);
        let section = &mut body.sections[self.section];
        section.mass = mass;
        section.center_of_mass = center;
        section.inertia = Vec3([xx, yy, zz]);
        section.products_of_inertia = Some(Vec3([xy, xz, yz]));
    }
}
