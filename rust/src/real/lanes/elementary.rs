//! Exponential, logarithm and hyperbolic tangent of lanes, without branches.
//!
//! Source: the Cephes library (S. L. Moshier, *Methods and Programs for Mathematical Functions*, 1989), `exp.c`, `tanh.c`:
//! rational approximations after range reduction. The logarithm: ln(m 2^e) = e ln 2 + 2 artanh((m - 1) / (m + 1)) by the series,
//! with m from sqrt(1/2) to sqrt(2).
//! Error: below 3e-16 relative for the exponential (normal results), below 5e-16 for the hyperbolic tangent and the
//! logarithm (tested).
//! Limits: the exponential is 0 below -745.2 and infinite above 709.8, as it should; not a number stays so.

use super::{Lanes, Register};
use crate::real::Real;

/// sum_k c[k] x^(n - k).
#[inline(always)]
fn polynomial<T: Real, const N: usize>(c: [f64; N], x: T) -> T {
    let mut sum = T::from_f64(c[0]);
    for &k in &c[1..] {
        sum = sum.mul_add(x, T::from_f64(k));
    }
    sum
}

/// `x` moved to the nearest whole number (ties to even) by adding and taking off 1.5 * 2^52; |x| < 2^51.
#[inline(always)]
fn round<T: Real>(x: T) -> T {
    const SHIFT: f64 = 6_755_399_441_055_744.0;
    x + SHIFT - SHIFT
}

/// e^x.
#[inline(always)]
pub(super) fn exp<R: Register>(x: Lanes<R>) -> Lanes<R> {
    // The choices keep a number that is none: no comparison with it holds.
    let x = Lanes::select(x - 710.0, Lanes::from_f64(710.0), x);
    let x = Lanes::select(-x - 750.0, Lanes::from_f64(-750.0), x);
    let n = round(x * std::f64::consts::LOG2_E);
    // ln 2 in two parts, the first with trailing zeros: n times it is exact.
    let r = n.neg_mul_add(Lanes::from_f64(6.931_457_519_531_25e-1), x);
    let r = n.neg_mul_add(Lanes::from_f64(1.428_606_820_309_417_2e-6), r);
    let rr = r * r;
    let p = r * polynomial([1.261_771_930_748_105_9e-4, 3.029_944_077_074_419_6e-2, 1.0], rr);
    let q = polynomial([3.001_985_051_386_644_6e-6, 2.524_483_403_496_841e-3, 2.272_655_482_081_550_3e-1, 2.0], rr);
    let e = p / (q - p) * 2.0 + 1.0;
    // In two steps: 2^n itself may be too small or too large where e^x is not.
    let half = round(n * 0.5);
    e * Lanes(half.0.power_of_two()) * Lanes((n - half).0.power_of_two())
}

/// ln(x) of a positive, normal number; not a number of any other.
#[inline(always)]
pub(super) fn ln<R: Register>(x: Lanes<R>) -> Lanes<R> {
    let (e, m) = (Lanes(x.0.exponent()), Lanes(x.0.mantissa()));
    let large = m - std::f64::consts::SQRT_2;
    let (e, m) = (Lanes::select(large, e + 1.0, e), Lanes::select(large, m * 0.5, m));
    let t = (m - 1.0) / (m + 1.0);
    let tt = t * t;
    // t^2 < 0.0295: the next term is below 1e-18.
    const SERIES: [f64; 10] = [
        2.0 / 21.0,
        2.0 / 19.0,
        2.0 / 17.0,
        2.0 / 15.0,
        2.0 / 13.0,
        2.0 / 11.0,
        2.0 / 9.0,
        2.0 / 7.0,
        2.0 / 5.0,
        2.0 / 3.0,
    ];
    let small = (t * tt).mul_add(polynomial(SERIES, tt), t * 2.0);
    // ln 2 in two parts, the first with trailing zeros: e times it is exact.
    let sum = e.mul_add(Lanes::from_f64(1.428_606_820_309_417_2e-6), small);
    let sum = e.mul_add(Lanes::from_f64(6.931_457_519_531_25e-1), sum);
    // Infinity times zero is not a number, either.
    Lanes::select(x, x.mul_add(Lanes::zero(), sum), Lanes::from_f64(f64::NAN))
}

/// tanh(x): a rational function near zero, 1 - 2 / (e^2|x| + 1) elsewhere.
#[inline(always)]
pub(super) fn tanh<R: Register>(x: Lanes<R>) -> Lanes<R> {
    let xx = x * x;
    let p = polynomial([-9.643_991_794_250_523e-1, -9.928_772_310_019_186e1, -1.614_687_684_417_084_5e3], xx);
    let q = polynomial([1.0, 1.128_116_784_916_329_3e2, 2.235_488_390_601_004_5e3, 4.844_063_053_251_255e3], xx);
    let near = (x * xx).mul_add(p / q, x);
    let size = x.abs();
    let far = Lanes::one() - Lanes::from_f64(2.0) / (exp(size * 2.0) + 1.0);
    let far = Lanes::select(x, far, -far);
    Lanes::select(size - 0.625, far, near)
}
