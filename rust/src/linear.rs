//! Vectors and 3 x 3 blocks over any [`Real`].
//!
//! A general linear-algebra crate is used where speed is no question (statics). These few operations are our own
//! because everything in the hot path must be inlined into one function, so that run-time chosen instruction sets
//! reach it.

use crate::real::Real;
use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A vector of three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vec3<T>(pub [T; 3]);

impl<T: Real> Vec3<T> {
    /// From components.
    #[inline(always)]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self([x, y, z])
    }
    /// The zero vector.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([T::zero(); 3])
    }
    /// A constant vector.
    #[inline(always)]
    pub fn from_f64(v: [f64; 3]) -> Self {
        Self(v.map(T::from_f64))
    }
    /// First component.
    #[inline(always)]
    pub fn x(&self) -> T {
        self.0[0]
    }
    /// Second component.
    #[inline(always)]
    pub fn y(&self) -> T {
        self.0[1]
    }
    /// Third component.
    #[inline(always)]
    pub fn z(&self) -> T {
        self.0[2]
    }
    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        self.0[0] * o.0[0] + self.0[1] * o.0[1] + self.0[2] * o.0[2]
    }
    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([b * z - c * y, c * x - a * z, a * y - b * x])
    }
}

impl<T: Real> Add for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self([self.0[0] + o.0[0], self.0[1] + o.0[1], self.0[2] + o.0[2]])
    }
}

impl<T: Real> Sub for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self([self.0[0] - o.0[0], self.0[1] - o.0[1], self.0[2] - o.0[2]])
    }
}

impl<T: Real> Neg for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|a| -a))
    }
}

impl<T: Real> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        Self(self.0.map(|a| a * k))
    }
}

impl<T: Real> AddAssign for Vec3<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<T: Real> SubAssign for Vec3<T> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

/// A 3 x 3 matrix, row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mat3<T>(pub [[T; 3]; 3]);

impl<T: Real> Mat3<T> {
    /// The zero matrix.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([[T::zero(); 3]; 3])
    }
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        let (o, i) = (T::zero(), T::one());
        Self([[i, o, o], [o, i, o], [o, o, i]])
    }
    /// The matrix of the vector product, `cross_matrix(a) b = a x b`.
    #[inline(always)]
    pub fn cross_matrix(a: Vec3<T>) -> Self {
        let ([x, y, z], o) = (a.0, T::zero());
        Self([[o, -z, y], [z, o, -x], [-y, x, o]])
    }
    /// Column `j`.
    #[inline(always)]
    pub fn column(&self, j: usize) -> Vec3<T> {
        Vec3([self.0[0][j], self.0[1][j], self.0[2][j]])
    }
    /// The matrix times a vector.
    #[inline(always)]
    pub fn mul_vec(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3(self.0.map(|r| Vec3(r).dot(v)))
    }
    /// The transposed matrix times a vector.
    #[inline(always)]
    pub fn transposed_mul_vec(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3(self.0[0]) * v.0[0] + Vec3(self.0[1]) * v.0[1] + Vec3(self.0[2]) * v.0[2]
    }
    /// Matrix product.
    #[inline(always)]
    pub fn mul_mat(&self, o: &Self) -> Self {
        Self(self.0.map(|r| o.transposed_mul_vec(Vec3(r)).0))
    }
    /// Elementwise sum.
    #[inline(always)]
    pub fn add(&self, o: &Self) -> Self {
        let mut out = *self;
        for i in 0..3 {
            for j in 0..3 {
                out.0[i][j] += o.0[i][j];
            }
        }
        out
    }
    /// Every element times `k`.
    #[inline(always)]
    pub fn scale(&self, k: T) -> Self {
        Self(self.0.map(|r| r.map(|a| a * k)))
    }
}

/// A symmetric 3 x 3 matrix: xx, xy, xz, yy, yz, zz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sym3<T>(pub [T; 6]);

impl<T: Real> Sym3<T> {
    /// The zero matrix.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([T::zero(); 6])
    }
    /// `R diag(d) R^T`.
    #[inline(always)]
    pub fn rotated_diagonal(r: &Mat3<T>, d: Vec3<T>) -> Self {
        let rows = r.0;
        let scaled = rows.map(|row| Vec3([row[0] * d.0[0], row[1] * d.0[1], row[2] * d.0[2]]));
        let e = |i: usize, j: usize| scaled[i].dot(Vec3(rows[j]));
        Self([e(0, 0), e(0, 1), e(0, 2), e(1, 1), e(1, 2), e(2, 2)])
    }
    /// From the diagonal and xy, xz, yz.
    #[inline(always)]
    pub fn from_moments_and_products(d: Vec3<T>, p: Vec3<T>) -> Self {
        Self([d.0[0], p.0[0], p.0[1], d.0[1], p.0[2], d.0[2]])
    }
    /// `R A R^T`.
    #[inline(always)]
    pub fn rotated(&self, r: &Mat3<T>) -> Self {
        let rows = r.0.map(Vec3);
        let turned = rows.map(|row| self.mul_vec(row));
        let e = |i: usize, j: usize| rows[i].dot(turned[j]);
        Self([e(0, 0), e(0, 1), e(0, 2), e(1, 1), e(1, 2), e(2, 2)])
    }
    /// `m (|c|^2 1 - c c^T)`: the inertia of a point mass `m` at `c` about the origin.
    #[inline(always)]
    pub fn of_point_mass(m: T, c: Vec3<T>) -> Self {
        let [x, y, z] = c.0;
        let (mx, my, mz) = (x * m, y * m, z * m);
        let (xx, yy, zz) = (mx * x, my * y, mz * z);
        Self([yy + zz, -(mx * y), -(mx * z), xx + zz, -(my * z), xx + yy])
    }
    /// The matrix times a vector.
    #[inline(always)]
    pub fn mul_vec(&self, v: Vec3<T>) -> Vec3<T> {
        let ([xx, xy, xz, yy, yz, zz], [x, y, z]) = (self.0, v.0);
        Vec3([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z])
    }
    /// Elementwise sum.
    #[inline(always)]
    pub fn add(&self, o: &Self) -> Self {
        let (a, b) = (self.0, o.0);
        Self([a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]])
    }
    /// As a full matrix.
    #[inline(always)]
    pub fn to_mat(&self) -> Mat3<T> {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        Mat3([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    }
    /// The inverse by the adjugate: one division, good for the well-scaled 3 x 3 joint inertias it is used on.
    #[inline(always)]
    pub fn inverse(&self) -> Self {
        let [xx, xy, xz, yy, yz, zz] = self.0;
        let (c0, c1, c2) = (yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let k = (xx * c0 + xy * c1 + xz * c2).recip();
        Self([c0 * k, c1 * k, c2 * k, (xx * zz - xz * xz) * k, (xy * xz - xx * yz) * k, (xx * yy - xy * xy) * k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symmetric_inverse_and_rotation() {
        let a = Sym3([4.0, 1.0, -0.5, 3.0, 0.25, 2.0]);
        let product = a.to_mat().mul_mat(&a.inverse().to_mat());
        let r = Mat3([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(Sym3::rotated_diagonal(&r, Vec3([1.0, 2.0, 3.0])), Sym3([2.0, 0.0, 0.0, 1.0, 0.0, 3.0]));
        for i in 0..3 {
            for j in 0..3 {
                assert!((product.0[i][j] - f64::from(i == j)).abs() < 1e-15);
            }
        }
        let (m, c) = (2.0, Vec3([0.3, -0.2, 0.5]));
        let cross = Mat3::cross_matrix(c);
        let by_cross = cross.mul_mat(&cross).scale(-m);
        assert!((by_cross.0[0][2] - Sym3::of_point_mass(m, c).0[2]).abs() < 1e-16);
        assert!((by_cross.0[1][1] - Sym3::of_point_mass(m, c).0[3]).abs() < 1e-16);
    }
}
