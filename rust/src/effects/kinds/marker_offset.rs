//! A marker that does not stand at the origin of the head it is fixed to.
//!
//! Form: r + R (x, y, z) is measured for the position of the head, r its origin, R its orientation: the place of the marker
//! in the frame of the head. The orientation is measured as it is. Acts on measured heads only, not on the arm.

use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::kinematics::section::Pose;
use crate::real::Real;
use crate::real::linear::Vec3;
use std::ops::Range;

/// Place of a marker.
#[derive(Clone, Debug)]
pub struct MarkerOffset<T> {
    place: Vec3<T>,
    sections: Range<usize>,
}

impl<T: Real> Effect<T> for MarkerOffset<T> {
    const SUMMARY: &'static str = "a marker beside the origin of its head: another point of the head is measured";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::Section];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("x", "m", -0.5..=0.5, "place of the marker in the head's frame").or(0.0),
        Parameter::new("y", "m", -0.5..=0.5, "the same along y").or(0.0),
        Parameter::new("z", "m", -0.5..=0.5, "the same along z").or(0.0),
    ];

    fn new(definition: &Definition, values: &[T]) -> Self {
        Self { place: Vec3([values[0], values[1], values[2]]), sections: definition.target.sections.clone() }
    }

    fn shapes_heads(&self) -> bool {
        true
    }

    fn see(&self, section: usize, head: &mut Pose<T>) {
        if self.sections.contains(&section) {
            head.position += head.rotation.mul_vec(self.place);
        }
    }
}
