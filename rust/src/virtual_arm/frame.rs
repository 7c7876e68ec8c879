//! A frame that is carried along the arm: pose, angular velocity, accelerations at q'' = 0, and its Jacobian.
//!
//! Source: kinematics of relative motion (Lynch & Park, *Modern Robotics*, ch. 5; any textbook of dynamics).
//! Frame: everything in the base frame.

use super::arc::ArcPoint;
use nalgebra::{Matrix3, Vector3};

/// Matrix times vector. nalgebra leaves its general product of small matrices out of line, at several times the cost.
#[inline(always)]
pub fn times(m: &Matrix3<f64>, v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        m.m11 * v.x + m.m12 * v.y + m.m13 * v.z,
        m.m21 * v.x + m.m22 * v.y + m.m23 * v.z,
        m.m31 * v.x + m.m32 * v.y + m.m33 * v.z,
    )
}

/// Matrix times matrix, column by column.
#[inline(always)]
pub fn product(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::from_columns(&[0, 1, 2].map(|k| times(a, &b.column(k).into_owned())))
}

/// A frame and how it moves with the coordinates below it.
pub struct Frame {
    pub rotation: Matrix3<f64>,
    pub position: Vector3<f64>,
    pub angular_velocity: Vector3<f64>,
    /// Acceleration of the origin at q'' = 0.
    pub bias: Vector3<f64>,
    /// Angular acceleration at q'' = 0.
    pub angular_bias: Vector3<f64>,
    /// Columns of J_v, one for each coordinate up to this frame's.
    pub linear: Vec<Vector3<f64>>,
    /// Columns of J_w.
    pub angular: Vec<Vector3<f64>>,
}

impl Frame {
    /// The base of the arm, at rest.
    pub fn base() -> Self {
        let zero = Vector3::zeros();
        Self {
            rotation: Matrix3::identity(),
            position: zero,
            angular_velocity: zero,
            bias: zero,
            angular_bias: zero,
            linear: Vec::new(),
            angular: Vec::new(),
        }
    }

    /// The frame fixed to this one with its origin at `offset` (in this frame).
    pub fn shifted(&self, offset: &Vector3<f64>) -> Self {
        let arm = times(&self.rotation, offset);
        let w = &self.angular_velocity;
        // Room for the three columns that `along` adds.
        let mut linear = Vec::with_capacity(self.linear.len() + 3);
        linear.extend(self.linear.iter().zip(&self.angular).map(|(v, w)| v + w.cross(&arm)));
        let mut angular = Vec::with_capacity(self.angular.len() + 3);
        angular.extend_from_slice(&self.angular);
        Self {
            position: self.position + arm,
            bias: self.bias + self.angular_bias.cross(&arm) + w.cross(&w.cross(&arm)),
            linear,
            angular,
            ..*self
        }
    }

    /// The frame at a point of the arc that starts in this one; adds the arc's three coordinates.
    pub fn along(&self, arc: &ArcPoint) -> Self {
        let r = &self.rotation;
        let mut out = self.shifted(&arc.position);
        let turning = times(r, &arc.angular_velocity);
        out.rotation = product(r, &arc.rotation);
        out.bias += 2.0 * self.angular_velocity.cross(&times(r, &arc.velocity)) + times(r, &arc.bias);
        out.angular_bias += self.angular_velocity.cross(&turning) + times(r, &arc.angular_bias);
        out.angular_velocity += turning;
        out.linear.extend(arc.linear.iter().map(|c| times(r, c)));
        out.angular.extend(arc.angular.iter().map(|c| times(r, c)));
        out
    }
}
