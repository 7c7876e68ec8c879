//! Forward-mode dual numbers: a value and its derivatives along `N` directions.
//!
//! Over lanes each lane has its own value and its own `N` directions: with one value in all lanes, `Dual<1, Lanes<R>>`
//! takes as many derivatives as there are lanes in one pass.

use super::{Kernel, Real};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// `value + sum_j derivative[j] eps_j` with `eps_j eps_k = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize, T = f64> {
    /// The value.
    pub value: T,
    /// The derivatives along the `N` directions.
    pub derivative: [T; N],
}

impl<const N: usize> Dual<N> {
    /// A variable: `value` with derivative one along `direction` (none if `direction >= N`).
    #[inline(always)]
    pub fn variable(value: f64, direction: usize) -> Self {
        let mut derivative = [0.0; N];
        if let Some(d) = derivative.get_mut(direction) {
            *d = 1.0;
        }
        Self { value, derivative }
    }
}

impl<const N: usize, T: Real> Dual<N, T> {
    /// A variable that is the same in every lane; `seed` gives the derivative along direction `j` of lane `k`, `j LANES + k`
    /// in all.
    #[inline(always)]
    pub fn seeded(value: f64, mut seed: impl FnMut(usize) -> f64) -> Self {
        let mut derivative = [T::zero(); N];
        for (j, d) in derivative.iter_mut().enumerate() {
            *d = T::from_lanes(|k| seed(j * T::LANES + k));
        }
        Self { value: T::from_f64(value), derivative }
    }

    /// The derivative along direction `j LANES + k`.
    #[inline(always)]
    pub fn along(&self, direction: usize) -> f64 {
        self.derivative[direction / T::LANES].lane(direction % T::LANES)
    }

    /// `f(self)` given `f` and `f'` at the value.
    #[inline(always)]
    fn chain(self, f: T, df: T) -> Self {
        let mut derivative = self.derivative;
        for d in &mut derivative {
            *d *= df;
        }
        Self { value: f, derivative }
    }
}

/// A number with `$value` and the derivatives `$each` of the two numbers' `$a` and `$b`. No closure: see `linear`.
macro_rules! combine {
    ($x:expr, $y:expr, $value:expr, $a:ident, $b:ident, $each:expr) => {{
        let mut derivative = $x.derivative;
        for (d, r) in derivative.iter_mut().zip(&$y.derivative) {
            let ($a, $b) = (*d, *r);
            *d = $each;
        }
        Self { value: $value, derivative }
    }};
}

impl<const N: usize, T: Real> Add for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, rhs: Self) -> Self {
        combine!(self, rhs, self.value + rhs.value, a, b, a + b)
    }
}

impl<const N: usize, T: Real> Sub for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, rhs: Self) -> Self {
        combine!(self, rhs, self.value - rhs.value, a, b, a - b)
    }
}

impl<const N: usize, T: Real> Mul for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // the product rule has a sum
    fn mul(self, rhs: Self) -> Self {
        combine!(self, rhs, self.value * rhs.value, a, b, a.mul_add(rhs.value, b * self.value))
    }
}

impl<const N: usize, T: Real> Div for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // the quotient rule has a product
    fn div(self, rhs: Self) -> Self {
        let inverse = rhs.value.recip();
        let quotient = self.value * inverse;
        combine!(self, rhs, quotient, a, b, b.neg_mul_add(quotient, a) * inverse)
    }
}

impl<const N: usize, T: Real> Neg for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut derivative = self.derivative;
        for d in &mut derivative {
            *d = -*d;
        }
        Self { value: -self.value, derivative }
    }
}

impl<const N: usize, T: Real> Add<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, rhs: f64) -> Self {
        Self { value: self.value + rhs, ..self }
    }
}

impl<const N: usize, T: Real> Sub<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, rhs: f64) -> Self {
        Self { value: self.value - rhs, ..self }
    }
}

impl<const N: usize, T: Real> Mul<f64> for Dual<N, T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, rhs: f64) -> Self {
        self.chain(self.value * rhs, T::from_f64(rhs))
    }
}

impl<const N: usize, T: Real> AddAssign for Dual<N, T> {
    #[inline(always)]
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl<const N: usize, T: Real> SubAssign for Dual<N, T> {
    #[inline(always)]
    fn sub_assign(&mut self, rhs: Self) {
        *self = *self - rhs;
    }
}

impl<const N: usize, T: Real> MulAssign for Dual<N, T> {
    #[inline(always)]
    fn mul_assign(&mut self, rhs: Self) {
        *self = *self * rhs;
    }
}

impl<const N: usize, T: Real> Real for Dual<N, T> {
    const LANES: usize = T::LANES;
    #[inline(always)]
    fn lane(self, k: usize) -> f64 {
        self.value.lane(k)
    }
    #[inline(always)]
    fn from_lanes(lane: impl FnMut(usize) -> f64) -> Self {
        Self { value: T::from_lanes(lane), derivative: [T::zero(); N] }
    }
    #[inline(always)]
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        T::enter(kernel)
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self { value: T::from_f64(x), derivative: [T::zero(); N] }
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        let mut derivative = b.derivative;
        for (d, (x, y)) in derivative.iter_mut().zip(self.derivative.iter().zip(&a.derivative)) {
            *d = x.mul_add(a.value, self.value.mul_add(*y, *d));
        }
        Self { value: self.value.mul_add(a.value, b.value), derivative }
    }
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        let mut derivative = b.derivative;
        for (d, (x, y)) in derivative.iter_mut().zip(self.derivative.iter().zip(&a.derivative)) {
            *d = x.mul_add(a.value, self.value.mul_sub(*y, *d));
        }
        Self { value: self.value.mul_sub(a.value, b.value), derivative }
    }
    #[inline(always)]
    fn neg_mul_add(self, a: Self, b: Self) -> Self {
        let mut derivative = b.derivative;
        for (d, (x, y)) in derivative.iter_mut().zip(self.derivative.iter().zip(&a.derivative)) {
            *d = x.neg_mul_add(a.value, self.value.neg_mul_add(*y, *d));
        }
        Self { value: self.value.neg_mul_add(a.value, b.value), derivative }
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let inverse = self.value.recip();
        self.chain(inverse, -(inverse * inverse))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, T::from_f64(0.5) / root)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), self.value.recip())
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let t = self.value.tanh();
        self.chain(t, t.neg_mul_add(t, T::one()))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(-self, -self, self)
    }
    #[inline(always)]
    fn select(condition: Self, then: Self, otherwise: Self) -> Self {
        let (c, value) = (condition.value, T::select(condition.value, then.value, otherwise.value));
        combine!(then, otherwise, value, a, b, T::select(c, a, b))
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.value.is_finite() && self.derivative.iter().all(|d| d.is_finite())
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        self.value.largest()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation against a central difference.
    #[test]
    fn derivatives_agree_with_differences() {
        fn f<T: Real>(x: T, y: T) -> T {
            let z = (x * y + 1.5).sqrt() / (y - x * 0.25) - (x * 0.3).exp() + (y * x).tanh() + x.powf(y);
            T::select(z, z, -z).max(x) + (x - y).abs() + (-x).min(y).recip()
        }
        let (x, y, h) = (0.7, 1.9, 1e-6);
        let d = f(Dual::<2>::variable(x, 0), Dual::<2>::variable(y, 1));
        let dx = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let dy = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        assert!((d.value - f(x, y)).abs() < 1e-14);
        assert!((d.derivative[0] - dx).abs() < 1e-8, "{} {dx}", d.derivative[0]);
        assert!((d.derivative[1] - dy).abs() < 1e-8, "{} {dy}", d.derivative[1]);
    }
}
