//! A spring whose force is a polynomial in its extension, without constant term, paper (26) and Fig. 8.

use crate::real::Real;

/// Force that resists the extension `e`, N; `stiffness` from the first power, N/m, N/m^2, ...
#[inline(always)]
pub fn force<T: Real>(stiffness: &[T], e: T) -> T {
    let mut sum = T::zero();
    for k in stiffness.iter().rev() {
        sum = sum.mul_add(e, *k);
    }
    sum * e
}

/// Its energy, the integral of the force from no extension, J.
pub fn energy<T: Real>(stiffness: &[T], e: T) -> T {
    let mut sum = T::zero();
    for (k, s) in stiffness.iter().enumerate().rev() {
        sum = (sum + *s * (1.0 / (k as f64 + 2.0))) * e;
    }
    sum * e
}

/// Its slope, N/m.
pub fn slope(stiffness: &[f64], e: f64) -> f64 {
    stiffness.iter().enumerate().rev().fold(0.0, |sum, (k, s)| sum * e + s * (k as f64 + 1.0))
}
