//! A one-sided wall against a head.
//!
//! Source: Kelvin-Voigt contact, force never pulling, with an onset rounded over a length e so that the step control of
//! the arm does not stumble over it. Rounded by a polynomial and not by a hyperbola, whose force decays as e^2 / (4 |d|)
//! only: a wall must not be felt from afar.
//! Form: depth d = n.(wall - r), n the wall's unit normal out of it, r the head's origin, in the world; rounded depth D(d):
//! 0 for d < -e, d for d > e, between them D = 2 e t^3 (1 - t / 2) with t = (d + e) / (2 e), D' = t^2 (3 - 2 t), which
//! joins both with two continuous derivatives; force n max(k D + c D' d', 0). Sign: pushes along n.
//! Validity: passive (energy of the spring: the integral of k D, not negative); a plane without friction against one
//! point; nothing at all acts from e before the wall outwards.

use crate::body::Body;
use crate::effects::{Definition, Effect, Instant, Parameter, PlaceKind};
use crate::forces::Wrench;
use crate::real::Real;
use crate::real::linear::Vec3;
use std::ops::Range;

/// A wall.
#[derive(Clone, Debug)]
pub struct Contact<T> {
    stiffness: T,
    damping: T,
    wall: Vec3<T>,
    normal: Vec3<T>,
    rounding: T,
    sections: Range<usize>,
}

/// The depth rounded over `e` to both sides of the wall, and its derivative by the depth.
#[inline(always)]
fn rounded<T: Real>(depth: T, e: T) -> (T, T) {
    let zero = T::zero();
    let t = ((depth + e) / (e * 2.0)).max(zero).min(T::one());
    let square = t * t;
    // 2 t^3 (1 - t / 2) = t^3 (2 - t); beyond e the rest of the depth.
    (e * square * t * (-t + 2.0) + (depth - e).max(zero), square * (t * -2.0 + 3.0))
}

impl<T: Real> Effect<T> for Contact<T> {
    const SUMMARY: &'static str = "one-sided wall against a head";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All, PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness", "N/m", 0.0..=1e6, "stiffness k of the wall"),
        Parameter::new("damping", "N s/m", 0.0..=1e4, "damping c while in contact").or(0.0),
        Parameter::new("wall_x", "m", -10.0..=10.0, "a point of the wall, in the world").or(0.0),
        Parameter::new("wall_y", "m", -10.0..=10.0, "a point of the wall, in the world").or(0.0),
        Parameter::new("wall_z", "m", -10.0..=10.0, "a point of the wall, in the world").or(0.0),
        Parameter::new("normal_x", "", -1.0..=1.0, "direction out of the wall; any length but zero").or(0.0),
        Parameter::new("normal_y", "", -1.0..=1.0, "direction out of the wall; any length but zero").or(0.0),
        Parameter::new("normal_z", "", -1.0..=1.0, "direction out of the wall; any length but zero").or(0.0),
        Parameter::new(
            "rounding",
            "m",
            1e-6..=0.1,
            "length e to both sides of the wall over which the onset is rounded",
        )
        .or(1e-3),
    ];
    const SEVERAL: bool = true;

    fn new(definition: &Definition, values: &[T]) -> Self {
        let direction = Vec3([values[5], values[6], values[7]]);
        Self {
            stiffness: values[0],
            damping: values[1],
            wall: Vec3([values[2], values[3], values[4]]),
            normal: direction * direction.dot(direction).sqrt().recip(),
            rounding: values[8],
            sections: definition.target.sections.clone(),
        }
    }

    fn objection(values: &[f64], _definition: &Definition, _body: &Body<f64>) -> Option<String> {
        let length = values[5..8].iter().map(|x| x * x).sum::<f64>().sqrt();
        (length < 1e-6).then(|| "normal_x, normal_y, normal_z must not all be zero".to_owned())
    }

    #[inline(always)]
    fn add_forces(&self, now: &mut Instant<'_, T>, _hidden: &[T]) {
        for i in self.sections.clone() {
            let link = &now.links[i];
            let depth = self.normal.dot(self.wall - link.position);
            let rate = -self.normal.dot(link.velocity);
            let (rounded, slope) = rounded(depth, self.rounding);
            let push = self.stiffness * rounded + self.damping * rate * slope;
            let force = self.normal * push.max(T::zero());
            now.loads[i].on_head.add(Wrench::at(link.position, force));
        }
    }
}
