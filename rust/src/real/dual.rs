//! Forward-mode dual numbers: a value and its derivatives along `N` directions.

use super::Real;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// `value + sum_j derivative[j] eps_j` with `eps_j eps_k = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// The value.
    pub value: f64,
    /// The derivatives along the `N` directions.
    pub derivative: [f64; N],
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

    /// `f(self)` given `f` and `f'` at the value.
    #[inline(always)]
    fn chain(self, f: f64, df: f64) -> Self {
        Self { value: f, derivative: self.derivative.map(|d| d * df) }
    }

    #[inline(always)]
    fn zip(self, rhs: Self, value: f64, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut derivative = self.derivative;
        for (d, r) in derivative.iter_mut().zip(&rhs.derivative) {
            *d = f(*d, *r);
        }
        Self { value, derivative }
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, rhs: Self) -> Self {
        self.zip(rhs, self.value + rhs.value, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, rhs: Self) -> Self {
        self.zip(rhs, self.value - rhs.value, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // the product rule has a sum
    fn mul(self, rhs: Self) -> Self {
        self.zip(rhs, self.value * rhs.value, |a, b| a * rhs.value + b * self.value)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, rhs: Self) -> Self {
        let inverse = 1.0 / rhs.value;
        let quotient = self.value * inverse;
        self.zip(rhs, quotient, |a, b| (a - b * quotient) * inverse)
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, rhs: f64) -> Self {
        Self { value: self.value + rhs, ..self }
    }
}

impl<const N: usize> Sub<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, rhs: f64) -> Self {
        Self { value: self.value - rhs, ..self }
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, rhs: f64) -> Self {
        self.chain(self.value * rhs, rhs)
    }
}

impl<const N: usize> AddAssign for Dual<N> {
    #[inline(always)]
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl<const N: usize> SubAssign for Dual<N> {
    #[inline(always)]
    fn sub_assign(&mut self, rhs: Self) {
        *self = *self - rhs;
    }
}

impl<const N: usize> MulAssign for Dual<N> {
    #[inline(always)]
    fn mul_assign(&mut self, rhs: Self) {
        *self = *self * rhs;
    }
}

impl<const N: usize> Real for Dual<N> {
    #[inline(always)]
    fn from_f64(x: f64) -> Self {
        Self { value: x, derivative: [0.0; N] }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    #[inline(always)]
    fn tanh(self) -> Self {
        let t = self.value.tanh();
        self.chain(t, 1.0 - t * t)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }
    #[inline(always)]
    fn select(condition: Self, then: Self, otherwise: Self) -> Self {
        if condition.value > 0.0 { then } else { otherwise }
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.value.is_finite() && self.derivative.iter().all(|d| d.is_finite())
    }
    #[inline(always)]
    fn largest(self) -> f64 {
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation against a central difference.
    #[test]
    fn derivatives_agree_with_differences() {
        fn f<T: Real>(x: T, y: T) -> T {
            let z = (x * y + 1.5).sqrt() / (y - x * 0.25) - (x * 0.3).exp() + (y * x).tanh();
            T::select(z, z, -z).max(x) + (x - y).abs() + (-x).min(y).recip()
        }
        let (x, y, h) = (0.7, 1.9, 1e-6);
        let d = f(Dual::<2>::variable(x, 0), Dual::<2>::variable(y, 1));
        let dx = (f(x + h, y) - f(x - h, y)) / (2.0 * h);
        let dy = (f(x, y + h) - f(x, y - h)) / (2.0 * h);
        assert_eq!(d.value, f(x, y));
        assert!((d.derivative[0] - dx).abs() < 1e-8, "{} {dx}", d.derivative[0]);
        assert!((d.derivative[1] - dy).abs() < 1e-8, "{} {dy}", d.derivative[1]);
    }
}
