//! Vectors and 3 x 3 blocks over any [`Real`].
//!
//! A general linear-algebra crate is used where speed is no question (statics). These few operations are our own
//! because everything in the hot path must be inlined into one function, so that run-time chosen instruction sets
//! reach it. For the same reason there are no closures here: the compiler may leave them, and what the standard library
//! does with them (`map`, `fold`), out of line.

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
    pub fn from_f64([x, y, z]: [f64; 3]) -> Self {
        Self([T::from_f64(x), T::from_f64(y), T::from_f64(z)])
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
        self.0[2].mul_add(o.0[2], self.0[1].mul_add(o.0[1], self.0[0] * o.0[0]))
    }
    /// `self * k + o`.
    #[inline(always)]
    pub fn mul_add(self, k: T, o: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, o.0);
        Self([x.mul_add(k, a), y.mul_add(k, b), z.mul_add(k, c)])
    }
    /// `o - self * k`.
    #[inline(always)]
    pub fn neg_mul_add(self, k: T, o: Self) -> Self {
        let ([x, y, z], [a, b, c]) = (self.0, o.0);
        Self([x.neg_mul_add(k, a), y.neg_mul_add(k, b), z.neg_mul_add(k, c)])
    }
    /// `self * k[0] + b * k[1] + c * k[2]`.
    #[inline(always)]
    pub fn combined(self, k: [T; 3], b: Self, c: Self) -> Self {
        c.mul_add(k[2], b.mul_add(k[1], self * k[0]))
    }
    /// Component by component.
    #[inline(always)]
    pub fn times(self, o: Self) -> Self {
        Self([self.0[0] * o.0[0], self.0[1] * o.0[1], self.0[2] * o.0[2]])
    }
    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        let ([a, b, c], [x, y, z]) = (self.0, o.0);
        Self([b.mul_sub(z, c * y), c.mul_sub(x, a * z), a.mul_sub(y, b * x)])
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
        let [x, y, z] = self.0;
        Self([-x, -y, -z])
    }
}

impl<T: Real> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, k: T) -> Self {
        let [x, y, z] = self.0;
        Self([x * k, y * k, z * k])
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
    /// A constant matrix.
    #[inline(always)]
    pub fn from_f64([a, b, c]: [[f64; 3]; 3]) -> Self {
        Self([Vec3::from_f64(a).0, Vec3::from_f64(b).0, Vec3::from_f64(c).0])
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
        let [a, b, c] = self.0;
        Vec3([Vec3(a).dot(v), Vec3(b).dot(v), Vec3(c).dot(v)])
    }
    /// The transposed matrix times a vector.
    #[inline(always)]
    pub fn transposed_mul_vec(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3(self.0[0]).combined(v.0, Vec3(self.0[1]), Vec3(self.0[2]))
    }
    /// The transposed matrix.
    #[inline(always)]
    pub fn transposed(&self) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = self.0;
        Self([[a, d, g], [b, e, h], [c, f, i]])
    }
    /// Matrix product.
    #[inline(always)]
    pub fn mul_mat(&self, o: &Self) -> Self {
        let [a, b, c] = self.0;
        Self([o.transposed_mul_vec(Vec3(a)).0, o.transposed_mul_vec(Vec3(b)).0, o.transposed_mul_vec(Vec3(c)).0])
    }
    /// `self - a b^T`.
    #[inline(always)]
    pub fn minus_product(&self, a: Vec3<T>, b: Vec3<T>) -> Self {
        let ([r, s, t], [x, y, z]) = (self.0, a.0);
        Self([b.neg_mul_add(x, Vec3(r)).0, b.neg_mul_add(y, Vec3(s)).0, b.neg_mul_add(z, Vec3(t)).0])
    }
    /// Elementwise sum.
    #[inline(always)]
    pub fn add(&self, o: &Self) -> Self {
        let ([a, b, c], [d, e, f]) = (self.0, o.0);
        Self([(Vec3(a) + Vec3(d)).0, (Vec3(b) + Vec3(e)).0, (Vec3(c) + Vec3(f)).0])
    }
    /// Every element times `k`.
    #[inline(always)]
    pub fn scale(&self, k: T) -> Self {
        let [a, b, c] = self.0;
        Self([(Vec3(a) * k).0, (Vec3(b) * k).0, (Vec3(c) * k).0])
    }
}

/// `a b - c d`.
#[inline(always)]
fn minor<T: Real>(a: T, b: T, c: T, d: T) -> T {
    a.mul_sub(b, c * d)
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
        let [a, b, c] = [Vec3(rows[0]), Vec3(rows[1]), Vec3(rows[2])];
        let (da, db, dc) = (a.times(d), b.times(d), c.times(d));
        Self([da.dot(a), da.dot(b), da.dot(c), db.dot(b), db.dot(c), dc.dot(c)])
    }
    /// From the diagonal and xy, xz, yz.
    #[inline(always)]
    pub fn from_moments_and_products(d: Vec3<T>, p: Vec3<T>) -> Self {
        Self([d.0[0], p.0[0], p.0[1], d.0[1], p.0[2], d.0[2]])
    }
    /// `R A R^T`.
    #[inline(always)]
    pub fn rotated(&self, r: &Mat3<T>) -> Self {
        let [a, b, c] = [Vec3(r.0[0]), Vec3(r.0[1]), Vec3(r.0[2])];
        let (ta, tb, tc) = (self.mul_vec(a), self.mul_vec(b), self.mul_vec(c));
        Self([a.dot(ta), a.dot(tb), a.dot(tc), b.dot(tb), b.dot(tc), c.dot(tc)])
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
        let [xx, xy, xz, yy, yz, zz] = self.0;
        Vec3([Vec3([xx, xy, xz]).dot(v), Vec3([xy, yy, yz]).dot(v), Vec3([xz, yz, zz]).dot(v)])
    }
    /// Elementwise sum.
    #[inline(always)]
    pub fn add(&self, o: &Self) -> Self {
        let (a, b) = (self.0, o.0);
        Self([a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]])
    }
    /// `self - a b^T`, where that is symmetric in sum with others like it: the upper half is computed.
    #[inline(always)]
    pub fn minus_product(&self, a: Vec3<T>, b: Vec3<T>) -> Self {
        let ([xx, xy, xz, yy, yz, zz], [x, y, z], [p, q, r]) = (self.0, a.0, b.0);
        Self([
            x.neg_mul_add(p, xx),
            x.neg_mul_add(q, xy),
            x.neg_mul_add(r, xz),
            y.neg_mul_add(q, yy),
            y.neg_mul_add(r, yz),
            z.neg_mul_add(r, zz),
        ])
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
        let (c0, c1, c2) = (minor(yy, zz, yz, yz), minor(xz, yz, xy, zz), minor(xy, yz, xz, yy));
        let k = Vec3([xx, xy, xz]).dot(Vec3([c0, c1, c2])).recip();
        let (c3, c4, c5) = (minor(xx, zz, xz, xz), minor(xy, xz, xx, yz), minor(xx, yy, xy, xy));
        Self([c0 * k, c1 * k, c2 * k, c3 * k, c4 * k, c5 * k])
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
