//! Small linear systems in place, row by row, for what runs every control period: nothing is allocated.

/// Pivots smaller than this part of the largest mean that a matrix is taken for singular.
const SINGULAR: f64 = 1e-5;

/// Solves A x = b by elimination with row pivoting, A (n x n) and b overwritten; false if A is close to singular.
pub(super) fn eliminate(a: &mut [f64], n: usize, b: &mut [f64]) -> bool {
    let largest = a.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs())).unwrap_or(k);
        if a[pivot * n + k].abs().is_nan() || a[pivot * n + k].abs() <= SINGULAR * largest {
            return false;
        }
        if pivot != k {
            let (above, below) = a.split_at_mut(pivot * n);
            above[k * n..(k + 1) * n].swap_with_slice(&mut below[..n]);
            b.swap(k, pivot);
        }
        let (above, below) = a.split_at_mut((k + 1) * n);
        let row = &above[k * n + k..];
        let inverse = row[0].recip();
        for (i, other) in below.chunks_exact_mut(n).enumerate() {
            let factor = other[k] * inverse;
            if factor != 0.0 {
                other[k..].iter_mut().zip(row).for_each(|(x, y)| *x -= factor * y);
                b[k + 1 + i] -= factor * b[k];
            }
        }
    }
    for k in (0..n).rev() {
        let row = &a[k * n..(k + 1) * n];
        let sum: f64 = row[k + 1..].iter().zip(&b[k + 1..]).map(|(a, x)| a * x).sum();
        b[k] = (b[k] - sum) / row[k];
    }
    true
}

/// Factorizes the symmetric positive `a` (n x n, lower triangle read) as L L^T, L in the lower triangle.
///
/// Returns whether it was positive definite.
pub(super) fn factorize(a: &mut [f64], n: usize) -> bool {
    for j in 0..n {
        for k in 0..j {
            let l = a[j * n + k];
            for i in j..n {
                a[i * n + j] -= a[i * n + k] * l;
            }
        }
        let pivot = a[j * n + j];
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        let inverse = pivot.sqrt().recip();
        for i in j..n {
            a[i * n + j] *= inverse;
        }
    }
    true
}

/// Solves L L^T x = b in place.
pub(super) fn solve(l: &[f64], n: usize, b: &mut [f64]) {
    for i in 0..n {
        let mut sum = b[i];
        for k in 0..i {
            sum -= l[i * n + k] * b[k];
        }
        b[i] = sum / l[i * n + i];
    }
    for i in (0..n).rev() {
        let mut sum = b[i];
        for k in i + 1..n {
            sum -= l[k * n + i] * b[k];
        }
        b[i] = sum / l[i * n + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elimination_solves_and_refuses() {
        // Needs its rows swapped.
        let a = [0.0, 2.0, 1.0, 1.0, 0.0, -1.0, 3.0, 1.0, 0.0];
        let x = [0.5, -2.0, 4.0];
        let mut b: Vec<f64> = a.chunks_exact(3).map(|r| r.iter().zip(&x).map(|(a, x)| a * x).sum()).collect();
        assert!(eliminate(&mut a.clone(), 3, &mut b));
        assert!(b.iter().zip(&x).all(|(b, x)| (b - x).abs() < 1e-14), "{b:?}");
        assert!(!eliminate(&mut [1.0, 2.0, 2.0, 4.0 + 1e-9], 2, &mut [1.0, 2.0]));
        assert!(!eliminate(&mut [f64::NAN; 4], 2, &mut [1.0, 2.0]));
    }
}
