//! The entire functions of s = psi^2 that replace sin(psi)/psi, (1 - cos psi)/psi^2 and their derivatives.
//!
//! Source: the Stumpff functions c_k(s) = sum_j (-s)^j / (k + 2j)! of celestial mechanics (Stumpff 1959; Danby,
//! *Fundamentals of Celestial Mechanics*, sec. 6.9), c_0 = cos psi, c_1 = sin psi / psi, c_2 = (1 - cos psi) / psi^2,
//! c_3 = (psi - sin psi) / psi^3. They obey c_k = 1/k! - s c_{k+2} and dc_k/ds = (k c_{k+2} - c_{k+1}) / 2, so every
//! derivative is again one of them and nothing divides by psi.
//! Validity: |psi| <= [`PSI_MAX`], relative error below 1e-14 where the function is not near a zero (tested); a section
//! that bends further has long since met itself.

use crate::real::Real;

/// Largest bending angle of a section for which the functions are accurate, rad (one and a half turns).
pub const PSI_MAX: f64 = 3.0 * std::f64::consts::PI;

/// The Stumpff functions c_0 ... c_6 at s.
#[derive(Clone, Copy, Debug)]
pub struct ArcFunctions<T> {
    /// c_0 ... c_6.
    pub c: [T; 7],
}

/// Terms of the two series; the last one is below 1e-16 of the sum at s = PSI_MAX^2.
const TERMS: usize = 14;

/// 1 / (first + 2 j)! with alternating sign.
const fn series(first: u32) -> [f64; TERMS] {
    let mut out = [0.0; TERMS];
    let mut factorial = 1.0;
    let mut k = 1;
    while k <= first {
        factorial *= k as f64;
        k += 1;
    }
    let mut sign = 1.0;
    let mut j = 0;
    while j < TERMS {
        out[j] = sign / factorial;
        sign = -sign;
        factorial *= (first as f64 + 2.0 * j as f64 + 1.0) * (first as f64 + 2.0 * j as f64 + 2.0);
        j += 1;
    }
    out
}

const C5: [f64; TERMS] = series(5);
const C6: [f64; TERMS] = series(6);

/// A polynomial as two interleaved Horner chains, half the latency of one.
#[inline(always)]
fn polynomial<T: Real>(c: &[f64; TERMS], x: T, xx: T) -> T {
    let mut even = T::from_f64(c[TERMS - 2]);
    let mut odd = T::from_f64(c[TERMS - 1]);
    let mut j = TERMS - 2;
    while j >= 2 {
        even = even.mul_add(xx, T::from_f64(c[j - 2]));
        odd = odd.mul_add(xx, T::from_f64(c[j - 1]));
        j -= 2;
    }
    odd.mul_add(x, even)
}

/// c_k = 1/k! - x c_{k+2}.
#[inline(always)]
fn down<T: Real>(inverse_factorial: f64, x: T, next: T) -> T {
    x.neg_mul_add(next, T::from_f64(inverse_factorial))
}

impl<T: Real> ArcFunctions<T> {
    /// The functions at `s = psi^2`: series at s/4, then the angle doubled.
    #[inline(always)]
    pub fn new(s: T) -> Self {
        let x = s * 0.25;
        let xx = x * x;
        let (h5, h6) = (polynomial(&C5, x, xx), polynomial(&C6, x, xx));
        let (h4, h3) = (down(1.0 / 24.0, x, h6), down(1.0 / 6.0, x, h5));
        let (h2, h1) = (down(0.5, x, h4), down(1.0, x, h3));
        let h0 = down(1.0, x, h2);
        // c_k(4x) from c_k(x): sums of products without cancellation.
        let c2 = h1 * h1 * 0.5;
        Self {
            c: [
                s.neg_mul_add(c2, T::one()),
                h0 * h1,
                c2,
                h0.mul_add(h3, h2) * 0.25,
                h3 * (h1 + 1.0) * 0.125,
                h2.mul_add(h3, h4 + h5) * 0.0625,
                h3.mul_add(h3, h5 * 2.0) * 0.03125,
            ],
        }
    }

    /// cos psi.
    #[inline(always)]
    pub fn cos(&self) -> T {
        self.c[0]
    }
    /// a = sin psi / psi.
    #[inline(always)]
    pub fn a(&self) -> T {
        self.c[1]
    }
    /// b = (1 - cos psi) / psi^2.
    #[inline(always)]
    pub fn b(&self) -> T {
        self.c[2]
    }
    /// d = (psi - sin psi) / psi^3.
    #[inline(always)]
    pub fn d(&self) -> T {
        self.c[3]
    }
    /// da/ds.
    #[inline(always)]
    pub fn a_s(&self) -> T {
        (self.c[3] - self.c[2]) * 0.5
    }
    /// db/ds.
    #[inline(always)]
    pub fn b_s(&self) -> T {
        self.c[4] - self.c[3] * 0.5
    }
    /// dd/ds.
    #[inline(always)]
    pub fn d_s(&self) -> T {
        (self.c[5] * 3.0 - self.c[4]) * 0.5
    }
    /// d2a/ds2.
    #[inline(always)]
    pub fn a_ss(&self) -> T {
        ((self.c[5] - self.c[4]) * 3.0 + self.c[3]) * 0.25
    }
    /// d2b/ds2.
    #[inline(always)]
    pub fn b_ss(&self) -> T {
        (self.c[6] * 8.0 - self.c[5] * 5.0 + self.c[4]) * 0.25
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::Dual;

    /// Against sin and cos where these are well conditioned, over the whole range of validity.
    #[test]
    fn agree_with_sine_and_cosine() {
        for k in 1..=1000 {
            let psi = PSI_MAX * f64::from(k) / 1000.0;
            let f = ArcFunctions::new(psi * psi);
            let scale = 1.0 / psi.max(1.0);
            assert!((f.cos() - psi.cos()).abs() < 1e-13, "cos at {psi}");
            assert!((f.a() - psi.sin() / psi).abs() < 1e-14 * (1.0 + scale), "a at {psi}");
            let half = (0.5 * psi).sin() / (0.5 * psi);
            assert!((f.b() - 0.5 * half * half).abs() < 2e-15, "b at {psi}");
            if psi > 0.5 {
                assert!((f.d() - (psi - psi.sin()) / psi.powi(3)).abs() < 2e-15, "d at {psi}");
            }
        }
    }

    /// Derivative formulas against automatic differentiation of the functions themselves, straight pose included.
    #[test]
    fn derivatives_agree_with_duals() {
        for s in [0.0, 1e-14, 1e-6, 0.3, 2.0, 9.0, 30.0] {
            let f = ArcFunctions::new(s);
            let d = ArcFunctions::new(Dual::<1>::variable(s, 0));
            let pairs =
                [(f.a_s(), d.a()), (f.b_s(), d.b()), (f.d_s(), d.d()), (f.a_ss(), d.a_s()), (f.b_ss(), d.b_s())];
            for (k, (closed, dual)) in pairs.into_iter().enumerate() {
                assert!((closed - dual.derivative[0]).abs() < 1e-14, "{k} at s = {s}: {closed} {dual:?}");
            }
        }
    }
}
