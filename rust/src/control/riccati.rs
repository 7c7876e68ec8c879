//! The discrete algebraic Riccati equation, and the two gains that come from it.
//!
//! P = A^T P A - A^T P B (R + B^T P B)^-1 B^T P A + Q by the structure-preserving doubling algorithm (Chu, Fan, Lin &
//! Wang, Int. J. Control 77 (2004) 767): quadratic convergence, k doublings stand for 2^k steps of the Riccati
//! recursion. Used when a controller is made or its gain renewed, not every period.

use crate::error::{Error, Result};
use nalgebra::DMatrix;
use std::sync::atomic::{AtomicBool, Ordering};

const DOUBLINGS: usize = 60;

/// The stabilizing solution P for positive semidefinite `q` and positive definite `r`.
///
/// # Errors
/// [`Error::Convergence`] where there is none: a mode that the inputs do not reach does not decay.
pub fn riccati(a: &DMatrix<f64>, b: &DMatrix<f64>, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    riccati_until(a, b, q, r, &AtomicBool::new(false))
}

/// As [`riccati`], unless `stop` is set meanwhile: [`Error::Interrupted`].
fn riccati_until(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    stop: &AtomicBool,
) -> Result<DMatrix<f64>> {
    let n = a.nrows();
    let failure = |why: &str| Error::Convergence(format!("no stabilizing solution of the Riccati equation: {why}"));
    let weighted = r.clone().cholesky().ok_or_else(|| failure("the input weights are not positive definite"))?;
    let mut a_k = a.clone();
    let mut g = b * weighted.solve(&b.transpose());
    let mut p = q.clone();
    let identity = DMatrix::<f64>::identity(n, n);
    for _ in 0..DOUBLINGS {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let w = (&identity + &g * &p).lu();
        let wa = w.solve(&a_k).ok_or_else(|| failure("it is singular"))?;
        let wg = w.solve(&g).ok_or_else(|| failure("it is singular"))?;
        let grown = a_k.transpose() * &p * &wa;
        g += &a_k * wg * a_k.transpose();
        a_k = &a_k * wa;
        p += &grown;
        // Rounding would slowly take the symmetry away.
        p = (&p + p.transpose()) * 0.5;
        g = (&g + g.transpose()) * 0.5;
        if !p.iter().all(|x| x.is_finite()) {
            return Err(failure("it diverges; some motion is neither damped nor reached by the inputs"));
        }
        if grown.amax() <= 1e-13 * p.amax() {
            return Ok(p);
        }
    }
    Err(failure("no convergence"))
}

/// The linear-quadratic regulator's K: u = -K x minimizes sum x^T Q x + u^T R u for x_{k+1} = A x + B u.
///
/// # Errors
/// As for [`riccati`]; [`Error::Interrupted`] if `stop` is set meanwhile.
pub fn regulator_gain(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    q: &DMatrix<f64>,
    r: &DMatrix<f64>,
    stop: &AtomicBool,
) -> Result<DMatrix<f64>> {
    let p = riccati_until(a, b, q, r, stop)?;
    let matrix = r + b.transpose() * &p * b;
    let right = b.transpose() * p * a;
    matrix
        .cholesky()
        .map(|c| c.solve(&right))
        .ok_or_else(|| Error::Convergence("the regulator's gain is singular".to_owned()))
}

/// The steady-state Kalman gain L: x += L (y - C x) for x_{k+1} = A x + w, y = C x + v with covariances `q` and `r`.
///
/// # Errors
/// As for [`riccati`], of the transposed problem: a mode that the sensors do not see does not decay.
pub fn filter_gain(a: &DMatrix<f64>, c: &DMatrix<f64>, q: &DMatrix<f64>, r: &DMatrix<f64>) -> Result<DMatrix<f64>> {
    let p = riccati(&a.transpose(), &c.transpose(), q, r)?;
    let matrix = r + c * &p * c.transpose();
    let right = c * p;
    let solved = matrix.cholesky().map(|f| f.solve(&right));
    solved.map(|l| l.transpose()).ok_or_else(|| Error::Convergence("the filter's gain is singular".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    /// Against the plain recursion, run until nothing changes.
    #[test]
    fn doubling_agrees_with_the_recursion() {
        let a = DMatrix::from_row_slice(3, 3, &[1.0, 0.1, 0.0, -0.2, 0.97, 0.1, 0.0, 0.05, 1.02]);
        let b = DMatrix::from_row_slice(3, 2, &[0.0, 0.1, 0.1, 0.0, 0.3, -0.2]);
        let q = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 0.5, 2.0]));
        let r = DMatrix::from_diagonal(&DVector::from_vec(vec![0.1, 0.4]));
        let mut p = q.clone();
        for _ in 0..5000 {
            let k = (&r + b.transpose() * &p * &b).try_inverse().unwrap() * b.transpose() * &p * &a;
            p = a.transpose() * &p * (&a - &b * k) + &q;
        }
        let found = riccati(&a, &b, &q, &r).unwrap();
        assert!((&found - &p).amax() < 1e-10 * p.amax(), "{}", found - p);
        let k = regulator_gain(&a, &b, &q, &r, &AtomicBool::new(false)).unwrap();
        let closed = &a - &b * k;
        assert!(closed.complex_eigenvalues().iter().all(|z| z.norm() < 1.0));
    }

    /// A scalar random walk in noise: the gain has a closed form.
    #[test]
    fn scalar_filter() {
        let (q, r) = (0.04_f64, 0.25_f64);
        let one = DMatrix::from_element(1, 1, 1.0);
        let gain = filter_gain(&one, &one, &(&one * q), &(&one * r)).unwrap()[(0, 0)];
        let p = 0.5 * (q + (q * q + 4.0 * q * r).sqrt());
        assert!((gain - p / (p + r)).abs() < 1e-12, "{gain}");
    }

    #[test]
    fn what_cannot_be_reached_is_an_error() {
        let a = DMatrix::from_element(1, 1, 1.1);
        let (zero, one) = (DMatrix::zeros(1, 1), DMatrix::from_element(1, 1, 1.0));
        assert!(riccati(&a, &zero, &one, &one).is_err());
    }
}
