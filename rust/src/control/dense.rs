//! Cholesky factors of small matrices in place, row by row, for what runs every control period: nothing is allocated.

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
