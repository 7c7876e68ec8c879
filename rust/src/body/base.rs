//! Where the arm's base stands in the world. Source: paper (12), wH_1b.

use super::check::finite;
use super::parameters::BaseParameters;
use crate::error::Result;
use crate::real::Real;
use crate::real::linear::{Mat3, Vec3};

/// Pose of the base in the world, in which gravity and all poses are.
#[derive(Clone, Copy, Debug)]
pub struct Base<T> {
    /// Its axes in the world, as columns.
    pub rotation: Mat3<T>,
    /// Its origin in the world, m.
    pub position: Vec3<T>,
}

impl Base<f64> {
    pub(super) fn new(p: Option<&BaseParameters>) -> Result<Self> {
        let Some(p) = p else {
            return Ok(Self { rotation: Mat3::identity(), position: Vec3::zero() });
        };
        for (x, w) in p.position.iter().zip(p.rotation) {
            finite("base", "position", *x)?;
            finite("base", "rotation", w)?;
        }
        Ok(Self { rotation: rotation(p.rotation), position: Vec3(p.position) })
    }

    /// The same with `c` of every number.
    pub(super) fn map<T: Real>(&self, c: impl Fn(f64) -> T + Copy) -> Base<T> {
        Base { rotation: Mat3(self.rotation.0.map(|row| row.map(c))), position: Vec3(self.position.0.map(c)) }
    }
}

/// Rodrigues: the rotation about `vector` by its length, rad. The two functions of the angle are those of its half, which
/// small angles leave their digits.
fn rotation(vector: [f64; 3]) -> Mat3<f64> {
    let w = Vec3(vector);
    let angle = w.dot(w).sqrt();
    let half = 0.5 * angle;
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { x.sin() / x };
    let (a, b) = (sinc(angle), 0.5 * sinc(half) * sinc(half));
    let k = Mat3::cross_matrix(w);
    let square = k.mul_mat(&k);
    Mat3::identity().add(&k.scale(a)).add(&square.scale(b))
}
