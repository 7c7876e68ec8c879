//! The linear systems of a linearly implicit method.
//!
//! An arm whose damping outweighs its masses (a soft pneumatic arm: 1,000 N s/m against 0.3 kg) is stiff: an explicit method
//! needs steps of 0.1 ms to follow a motion of seconds. (I - gamma h J) k = r needs only J, here by forward differences:
//! a W-method keeps its order whatever stands for J, so that the differences cost accuracy of damping fast modes alone.

use super::System;
use crate::real::Real;

/// Difference of a coordinate (m, m/s): small beside anything that moves, large beside rounding.
const STEP: f64 = 1e-7;

/// Matrix I - gamma h J, factored; allocated once.
#[derive(Clone, Debug)]
pub(super) struct Implicit<T> {
    n: usize,
    /// Row by row; after [`Implicit::factor`] L (unit diagonal) and U.
    matrix: Vec<T>,
    varied: Vec<T>,
    derivative: Vec<T>,
    /// gamma h df/dt.
    drift: Vec<T>,
}

impl<T: Real> Implicit<T> {
    pub(super) fn new(n: usize) -> Self {
        let zero = vec![T::zero(); n];
        Self { n, matrix: vec![T::zero(); n * n], varied: zero.clone(), derivative: zero.clone(), drift: zero }
    }

    /// Factors I - `gamma_h` J, J at (`t`, `x`) where the derivative is `f`, and notes how `f` drifts with time: without that
    /// a stiff state would follow its input by an error of first order in the step.
    ///
    /// Without pivoting: the matrix is similar to M + gamma h D + (gamma h)^2 K for the arm's inertia, damping and stiffness,
    /// and lanes could not choose different pivots. A zero pivot shows as a state that is not finite.
    #[inline(always)]
    pub(super) fn factor<S: System<T>>(&mut self, system: &mut S, t: f64, x: &[T], f: &[T], gamma_h: f64) {
        let n = self.n;
        for j in 0..n {
            self.varied.copy_from_slice(x);
            self.varied[j] += T::from_f64(STEP);
            system.derivative(t, &self.varied, &mut self.derivative);
            for i in 0..n {
                let identity = if i == j { 1.0 } else { 0.0 };
                self.matrix[i * n + j] = (self.derivative[i] - f[i]) * (-gamma_h / STEP) + identity;
            }
        }
        let later = 1e-3 * gamma_h;
        system.derivative(t + later, x, &mut self.derivative);
        for ((drift, now), f) in self.drift.iter_mut().zip(&self.derivative).zip(f) {
            *drift = (*now - *f) * (gamma_h / later);
        }
        for k in 0..n {
            let inverse = self.matrix[k * n + k].recip();
            for i in k + 1..n {
                let factor = self.matrix[i * n + k] * inverse;
                self.matrix[i * n + k] = factor;
                for j in k + 1..n {
                    let change = factor * self.matrix[k * n + j];
                    self.matrix[i * n + j] -= change;
                }
            }
        }
    }

    /// Adds `sign` times gamma h df/dt to a right-hand side.
    #[inline(always)]
    pub(super) fn add_drift(&self, sign: f64, r: &mut [T]) {
        for (r, drift) in r.iter_mut().zip(&self.drift) {
            *r += *drift * sign;
        }
    }

    /// Solves in place with the matrix factored last.
    #[inline(always)]
    pub(super) fn solve(&self, r: &mut [T]) {
        let n = self.n;
        for i in 0..n {
            for j in 0..i {
                let change = self.matrix[i * n + j] * r[j];
                r[i] -= change;
            }
        }
        for i in (0..n).rev() {
            for j in i + 1..n {
                let change = self.matrix[i * n + j] * r[j];
                r[i] -= change;
            }
            r[i] *= self.matrix[i * n + i].recip();
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::integrate::{Integrator, Method, Options, System};

    /// Prothero and Robinson's problem: x' = -rate (x - sin t) + cos t, solved by sin t, beside a free oscillation.
    struct Stiff(f64);

    impl System<f64> for Stiff {
        fn derivative(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
            dx[0] = -self.0 * (x[0] - t.sin()) + t.cos();
            dx[1] = x[2];
            dx[2] = -4.0 * x[1] - x[1] * x[1] * x[1];
        }
    }

    fn end(rate: f64, step: f64) -> Vec<f64> {
        let mut integrator =
            Integrator::new(Options { method: Method::Ros2, step, ..Options::default() }, 0.0, &[0.0, 0.3, 0.0]);
        integrator.run(&mut Stiff(rate), &[2.0], &mut |_, _| (), &mut || false).unwrap();
        integrator.state().to_vec()
    }

    #[test]
    fn stiff_modes_do_not_limit_the_step() {
        // An explicit method would need steps below 2.8e-6 s. Without df/dt the error would be of first order, 1e-2 here.
        let error = |step| (end(1e6, step)[0] - 2.0_f64.sin()).abs();
        let (coarse, fine) = (error(0.05), error(0.025));
        assert!(coarse < 1e-3, "{coarse}");
        assert!((3.3..4.8).contains(&(coarse / fine)), "{coarse} {fine}");
    }

    #[test]
    fn the_order_is_two() {
        let exact = end(10.0, 1e-4);
        let error = |step| {
            let x = end(10.0, step);
            (0..3).map(|k| (x[k] - exact[k]).abs()).fold(0.0, f64::max)
        };
        let ratio = error(0.04) / error(0.02);
        assert!((3.3..4.8).contains(&ratio), "{ratio}");
    }
}
