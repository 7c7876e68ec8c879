//! The base stands askew: gravity comes from another direction, and the heads are elsewhere in the world.
//!
//! Form: seen from the base gravity is turned by R = exp([w]x), w = (about_x, about_y, 0) in the base frame, so the base is
//! turned by -w about its own origin: its pose (12) becomes that of the file times R^T. Camera, walls, anchors and external
//! forces stay where they are in the world.
//! Sign: right-handed; about_y > 0 turns a gravity along z towards x, and the arm's far end towards -x.
//! Acts by changing the arm's base. Validity: any angle up to a right angle; tilt about z is no tilt for gravity along z.

use crate::body::Body;
use crate::effects::{Definition, Effect, Parameter, PlaceKind};
use crate::kinematics::arc::ArcFunctions;
use crate::real::Real;
use crate::real::linear::{Mat3, Vec3};

/// Tilt of the base.
#[derive(Clone, Debug)]
pub struct BaseTilt<T> {
    turn: Vec3<T>,
}

impl<T: Real> Effect<T> for BaseTilt<T> {
    const SUMMARY: &'static str = "the base stands askew: gravity from another direction, heads elsewhere";
    const PLACES: &'static [PlaceKind] = &[PlaceKind::All];
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("about_x", "rad", -1.6..=1.6, "turn of gravity about the base's x axis, as the base sees it"),
        Parameter::new("about_y", "rad", -1.6..=1.6, "turn of gravity about the base's y axis, as the base sees it"),
    ];
    const CHANGES_ARM: bool = true;

    fn new(_definition: &Definition, values: &[T]) -> Self {
        Self { turn: Vec3([values[0], values[1], T::zero()]) }
    }

    fn change_arm(&self, body: &mut Body<T>) {
        // Rodrigues: R^T = 1 - a [w]x + b [w]x^2.
        let f = ArcFunctions::new(self.turn.dot(self.turn));
        let k = Mat3::cross_matrix(self.turn);
        let back = Mat3::identity().add(&k.scale(-f.a())).add(&k.mul_mat(&k).scale(f.b()));
        body.base.rotation = body.base.rotation.mul_mat(&back);
    }
}
