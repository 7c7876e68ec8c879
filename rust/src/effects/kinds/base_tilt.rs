//! Gravity from another direction: the base stands askew.
//!
//! Form: g -> R g with R = exp([w]x), w = (about_x, about_y, 0) in the base frame, so an arm whose base is turned by -w.
//! Sign: right-handed; about_y > 0 turns a gravity along z towards x. Acts by changing the arm's gravity.
//! Validity: any angle up to a right angle; tilt about z is no tilt for gravity along z.

use crate::body::Body;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::kinematics::arc::ArcFunctions;
use crate::real::Real;
use crate::real::linear::Vec3;

/// Tilt of the base.
#[derive(Clone, Debug)]
pub struct BaseTilt<T> {
    turn: Vec3<T>,
}

impl<T: Real> Effect<T> for BaseTilt<T> {
    const SUMMARY: &'static str = "gravity from another direction";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("about_x", "rad", -1.6..=1.6, "turn of gravity about the base's x axis"),
        Parameter::new("about_y", "rad", -1.6..=1.6, "turn of gravity about the base's y axis"),
    ];
    const CHANGES_ARM: bool = true;

    fn new(_definition: &Definition, values: &[T]) -> Self {
        Self { turn: Vec3([values[0], values[1], T::zero()]) }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        // Rodrigues: R g = g + a (w x g) + b w x (w x g).
        let (w, f) = (self.turn, ArcFunctions::new(self.turn.dot(self.turn)));
        let once = w.cross(body.gravity);
        body.gravity = body.gravity + once * f.a() + w.cross(once) * f.b();
    }
}
