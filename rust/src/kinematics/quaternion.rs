//! Orientations as unit quaternions, scalar first: what files and people read. Inside, orientations are matrices.
//!
//! Source: S. W. Shepperd, *Quaternion from rotation matrix*, J. Guidance and Control 1(3), 1978: the largest of the four
//! entries comes from a root, so that nothing is divided by a small number.
//! Sign: q and -q are the same rotation; the one with w >= 0 is taken (at w = 0 the one whose first entry that is not zero
//! is positive). So a quaternion follows from the pose alone, whatever came before it; who interpolates or compares takes
//! the sign nearer to the neighbour.

use super::section::Pose;
use crate::real::Real;
use crate::real::linear::Mat3;

/// The unit quaternion (w, x, y, z) of a rotation: w >= 0.
pub fn from_rotation(rotation: &Mat3<f64>) -> [f64; 4] {
    let [[a, b, c], [d, e, f], [g, h, i]] = rotation.0;
    // Four times the products of the entries, row by row.
    let products = [
        [1.0 + a + e + i, h - f, c - g, d - b],
        [h - f, 1.0 + a - e - i, b + d, c + g],
        [c - g, b + d, 1.0 - a + e - i, f + h],
        [d - b, c + g, f + h, 1.0 - a - e + i],
    ];
    let largest = (1..4).fold(0, |best, k| if products[k][k] > products[best][best] { k } else { best });
    let row = products[largest];
    let norm = row.iter().map(|v| v * v).sum::<f64>().sqrt();
    let sign = if row.iter().copied().find(|v| *v != 0.0).is_some_and(|v| v < 0.0) { -1.0 } else { 1.0 };
    // Adding zero: no entry is written as -0.
    row.map(|v| sign * v / norm + 0.0)
}

impl<T: Real> Pose<T> {
    /// Lane `k` by itself.
    pub fn lane(&self, k: usize) -> Pose<f64> {
        let of = |v: [T; 3]| v.map(|v| v.lane(k));
        Pose { rotation: Mat3(self.rotation.0.map(of)), position: crate::real::linear::Vec3(of(self.position.0)) }
    }
}

impl Pose<f64> {
    /// The orientation as a unit quaternion (w, x, y, z), w >= 0.
    pub fn quaternion(&self) -> [f64; 4] {
        from_rotation(&self.rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::linear::Vec3;

    /// The rotation of a unit quaternion, by its definition.
    fn rotation([w, x, y, z]: [f64; 4]) -> Mat3<f64> {
        Mat3([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ])
    }

    #[test]
    fn quaternions_give_back_their_rotations() {
        // About axes all around, by angles up to a whole turn, half turns among them.
        for i in 0..12 {
            for k in 0..=24 {
                let (a, b, angle) = (0.9 * f64::from(i), 0.35 * f64::from(i) - 1.0, f64::from(k) * 15f64.to_radians());
                let axis = [a.cos() * b.cos(), a.sin() * b.cos(), b.sin()];
                let (s, c) = (0.5 * angle).sin_cos();
                let q = [c, s * axis[0], s * axis[1], s * axis[2]];
                let found = from_rotation(&rotation(q));
                let along: f64 = found.iter().zip(q).map(|(a, b)| a * b).sum();
                assert!(found[0] >= 0.0 && (along.abs() - 1.0).abs() < 1e-15, "{q:?} {found:?}");
                assert!((found.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-15);
            }
        }
        // Exact half turns: the first entry that is not zero is positive; no entry is -0.
        for (k, q) in [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]].into_iter().enumerate() {
            assert_eq!(from_rotation(&rotation(q)), q, "{k}");
            assert_eq!(from_rotation(&rotation(q.map(|v| -v))), q, "{k}");
        }
        assert_eq!(from_rotation(&Mat3::identity()).map(f64::to_bits), [1.0, 0.0, 0.0, 0.0].map(f64::to_bits));
        let pose = Pose { rotation: Mat3::identity(), position: Vec3([1.0, 2.0, 3.0]) };
        assert_eq!((pose.lane(0).position.0, pose.quaternion()), ([1.0, 2.0, 3.0], [1.0, 0.0, 0.0, 0.0]));
    }
}
