//! The linear systems of a linearly implicit method.
//!
//! An arm whose damping outweighs its masses (a soft pneumatic arm: 1,000 N s/m against 0.3 kg) is stiff: an explicit method
//! needs steps of 0.1 ms to follow a motion of seconds. (I - gamma h J) k = r needs J = df/dx, here by forward differences
//! of the whole right-hand side, hidden states and chambers included: good to about 1e-6, which the methods tolerate
//! (they are W-methods: of order 2 whatever stands for J), and cheap beside exact derivatives, which see neither
//! (docs/decisions/0002-stiff-arms.md). For the same reason J may be kept over some steps ([`super::Integrator::keeping`]).
//! Where x = (q, q') the rows of q are known: q' is q', so that half of J is left to find and elimination leaves one
//! system of half the size, (I - g D - g^2 K) k = r + g K r_q with g = gamma h, K = df/dq and D = df/dq'.

use super::System;
use crate::real::Real;

/// Difference of a coordinate (m, m/s): small beside anything that moves, large beside rounding.
const STEP: f64 = 1e-7;
/// Part of a step over which f's drift with time is taken, twice.
const LATER: f64 = 5e-3;
/// Evaluations of the right-hand side in [`Implicit::drift`].
pub(super) const DRIFT_EVALUATIONS: u64 = 2;

/// Jacobian and matrix I - gamma h J, factored; allocated once.
#[derive(Clone, Debug)]
pub(super) struct Implicit<T> {
    /// Leading states whose derivatives are the trailing ones.
    pub(super) positions: usize,
    /// f at the step's start.
    pub(super) derivative: Vec<T>,
    /// df_i/dx_j of the other states, column by column.
    jacobian: Vec<T>,
    /// Row by row; after [`Implicit::factor`] L (unit diagonal) and U, the diagonal inverted.
    matrix: Vec<T>,
    /// df/dt.
    drift: Vec<T>,
    gamma_h: f64,
    varied: Vec<T>,
    other: Vec<T>,
}

impl<T: Real> Implicit<T> {
    /// For `n` states.
    pub(super) fn new(n: usize) -> Self {
        let zero = vec![T::zero(); n];
        Self {
            positions: 0,
            derivative: zero.clone(),
            jacobian: vec![T::zero(); n * n],
            matrix: vec![T::zero(); n * n],
            drift: zero.clone(),
            gamma_h: 0.0,
            varied: zero.clone(),
            other: zero,
        }
    }

    /// Evaluations of the right-hand side in [`Implicit::differentiate`].
    pub(super) fn evaluations(&self) -> u64 {
        self.varied.len() as u64
    }

    /// Takes J at (`t`, `x`), where [`Implicit::derivative`] holds f.
    #[inline(always)]
    pub(super) fn differentiate<S: System<T>>(&mut self, system: &mut S, t: f64, x: &[T]) {
        let n = x.len();
        self.positions = if system.is_second_order() { n / 2 } else { 0 };
        let (p, inverse) = (self.positions, 1.0 / STEP);
        for j in 0..n {
            self.varied.copy_from_slice(x);
            self.varied[j] += T::from_f64(STEP);
            system.derivative(t, &self.varied, &mut self.other);
            for i in p..n {
                self.jacobian[j * n + i] = (self.other[i] - self.derivative[i]) * inverse;
            }
        }
    }

    /// Takes df/dt at (`t`, `x`) for a step of length `h`. Without it a stiff state would follow its input by an error of
    /// first order in the step.
    #[inline(always)]
    pub(super) fn drift<S: System<T>>(&mut self, system: &mut S, t: f64, x: &[T], h: f64) {
        // (-3 f0 + 4 f1 - f2) / (2 later).
        let later = LATER * h;
        system.derivative(t + later, x, &mut self.other);
        for i in 0..x.len() {
            self.drift[i] = (self.other[i] * 4.0 - self.derivative[i] * 3.0) * (0.5 / later);
        }
        system.derivative(t + 2.0 * later, x, &mut self.other);
        for i in 0..x.len() {
            self.drift[i] -= self.other[i] * (0.5 / later);
        }
    }

    /// Factors I - `gamma_h` J.
    ///
    /// Without pivoting: the matrix is M^-1 (M + gamma h D + (gamma h)^2 K) with the arm's inertia, damping and stiffness,
    /// and lanes could not choose different pivots. A zero pivot shows as a state that is not finite.
    #[inline(always)]
    pub(super) fn factor(&mut self, gamma_h: f64) {
        self.gamma_h = gamma_h;
        let (n, p) = (self.varied.len(), self.positions);
        let m = n - p;
        for i in 0..m {
            for j in 0..m {
                let mut sum = self.jacobian[(p + j) * n + p + i] * -gamma_h;
                if p > 0 {
                    sum -= self.jacobian[j * n + p + i] * (gamma_h * gamma_h);
                }
                self.matrix[i * m + j] = if i == j { sum + 1.0 } else { sum };
            }
        }
        for k in 0..m {
            let inverse = self.matrix[k * m + k].recip();
            self.matrix[k * m + k] = inverse;
            for i in k + 1..m {
                let factor = self.matrix[i * m + k] * inverse;
                self.matrix[i * m + k] = factor;
                for j in k + 1..m {
                    self.matrix[i * m + j] = factor.neg_mul_add(self.matrix[k * m + j], self.matrix[i * m + j]);
                }
            }
        }
    }

    /// Adds `sign` times gamma h df/dt to a right-hand side.
    #[inline(always)]
    pub(super) fn add_drift(&self, sign: f64, r: &mut [T]) {
        if sign == 0.0 {
            return;
        }
        for (r, drift) in r.iter_mut().zip(&self.drift) {
            *r += *drift * (sign * self.gamma_h);
        }
    }

    /// Solves in place with the matrix factored last.
    #[inline(always)]
    pub(super) fn solve(&self, r: &mut [T]) {
        let (n, p) = (self.varied.len(), self.positions);
        let m = n - p;
        let (rq, r) = r.split_at_mut(p);
        for (j, rq) in rq.iter().enumerate() {
            let weight = *rq * self.gamma_h;
            for i in 0..m {
                r[i] = self.jacobian[j * n + p + i].mul_add(weight, r[i]);
            }
        }
        for i in 0..m {
            let mut sum = r[i];
            for j in 0..i {
                sum = self.matrix[i * m + j].neg_mul_add(r[j], sum);
            }
            r[i] = sum;
        }
        for i in (0..m).rev() {
            let mut sum = r[i];
            for j in i + 1..m {
                sum = self.matrix[i * m + j].neg_mul_add(r[j], sum);
            }
            r[i] = sum * self.matrix[i * m + i];
        }
        for (rq, rate) in rq.iter_mut().zip(r) {
            *rq += *rate * self.gamma_h;
        }
    }
}
