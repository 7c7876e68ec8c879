//! Exponentials of linear decay, as exact updates need them.

use crate::real::Real;

/// phi_0 ... phi_3 at -x, x >= 0: phi_0 = e^-x, phi_k(-x) = (1/(k-1)! - phi_{k-1}(-x)) / x.
///
/// For small x the recursion cancels; there the series of phi_3 is used and the recursion run downward.
/// Source: Hochbruck & Ostermann, Acta Numerica 19 (2010) 209-286, (2.10).
#[inline(always)]
pub fn phi<T: Real>(x: T) -> [T; 4] {
    let one = T::one();
    // Downward from the series, exact to 1e-15 for x <= 1/2.
    let (half, large) = (T::from_f64(0.5), x - 0.5);
    let y = T::select(large, half, x);
    let mut s3 = T::zero();
    // 1 / (j + 3)! for j = 10 ... 0.
    const C: [f64; 11] = [
        1.0 / 6_227_020_800.0,
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
    ];
    for c in C {
        s3 = T::from_f64(c) - y * s3;
    }
    let s2 = half - y * s3;
    let s1 = one - y * s2;
    let s0 = one - y * s1;
    // Upward from the exponential for the rest.
    let z = T::select(large, x, half);
    let inverse = z.recip();
    let e0 = (-z).exp();
    let e1 = (one - e0) * inverse;
    let e2 = (one - e1) * inverse;
    let e3 = (half - e2) * inverse;
    [T::select(large, e0, s0), T::select(large, e1, s1), T::select(large, e2, s2), T::select(large, e3, s3)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agree_with_quadrature() {
        for x in [0.0, 1e-9, 1e-4, 0.1, 0.499, 0.5, 0.501, 1.0, 7.0, 80.0] {
            let f = phi(x);
            assert!((f[0] - (-x).exp()).abs() < 1e-15, "{x}");
            // phi_k(-x) = int_0^1 e^{-(1 - s) x} s^(k-1) / (k-1)! ds, by Simpson's rule.
            let n = 20_000;
            for k in 1..4 {
                let g = |s: f64| (-(1.0 - s) * x).exp() * s.powi(k - 1) / if k == 3 { 2.0 } else { 1.0 };
                let h = 1.0 / f64::from(n);
                let sum: f64 = (0..n)
                    .map(|j| {
                        let a = f64::from(j) * h;
                        (g(a) + 4.0 * g(a + 0.5 * h) + g(a + h)) * h / 6.0
                    })
                    .sum();
                assert!((f[k as usize] - sum).abs() < 1e-12, "phi_{k} at {x}: {} {sum}", f[k as usize]);
            }
        }
    }
}
