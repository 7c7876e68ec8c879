//! The linear model around a state: x' = A x + B p in deviations, x = (q, q').
//!
//! Exact derivatives of the equations of motion (48), [`crate::dynamics::derivatives`].

use crate::arm::Arm;
use crate::dynamics::derivatives::{Point, differentiator};
use crate::real::InstructionSet;
use nalgebra::DMatrix;

/// A (2m x 2m) and B (2m x inputs), m coordinates.
#[derive(Clone, Debug)]
pub struct Linearization {
    /// d(q', q'')/d(q, q').
    pub state: DMatrix<f64>,
    /// d(q', q'')/dp, per Pa.
    pub input: DMatrix<f64>,
}

/// The linearization of `arm` at lengths `q`, rates `qd` and pressures `p` (Pa absolute).
pub fn linearize(arm: &Arm, q: &[f64], qd: &[f64], p: &[f64]) -> Linearization {
    let (m, inputs) = (arm.coordinates(), arm.body.inputs);
    let mut state = DMatrix::zeros(2 * m, 2 * m);
    let mut input = DMatrix::zeros(2 * m, inputs);
    for k in 0..m {
        state[(k, m + k)] = 1.0;
    }
    let (mut qdd, mut rows) = (vec![0.0; m], vec![0.0; m * (2 * m + inputs)]);
    differentiator(arm, &[], InstructionSet::best()).run(Point { q, qd, p, f_ext: None }, &mut qdd, &mut rows);
    for (direction, row) in rows.chunks_exact(m).enumerate() {
        for (k, d) in row.iter().enumerate() {
            if direction < 2 * m {
                state[(m + k, direction)] = *d;
            } else {
                input[(m + k, direction - 2 * m)] = *d;
            }
        }
    }
    Linearization { state, input }
}

impl Linearization {
    /// Over a period `h` with the pressures held: x_{k+1} = A_d x_k + B_d p_k, by the matrix exponential.
    pub fn discretized(&self, h: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, m) = (self.state.nrows(), self.input.ncols());
        let mut block = DMatrix::zeros(n + m, n + m);
        block.view_mut((0, 0), (n, n)).copy_from(&(&self.state * h));
        block.view_mut((0, n), (n, m)).copy_from(&(&self.input * h));
        let exponential = block.exp();
        (exponential.view((0, 0), (n, n)).into_owned(), exponential.view((0, n), (n, m)).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::{arms, states};
    use crate::dynamics::Workspace;
    use crate::dynamics::recursion::forward_dynamics_into;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_differences(arm in arms(), seed in states(), which in 0..100_usize) {
            let (m, q, qd, p) = (arm.coordinates(), seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
            let linear = linearize(&arm, &q, &qd, &p);
            let column = which % (2 * m + arm.body.inputs);
            let mut ws = Workspace::new(&arm);
            let mut at = |sign: f64| {
                let (mut q, mut qd, mut p) = (q.clone(), qd.clone(), p.clone());
                let step = if column < m { 1e-5 } else if column < 2 * m { 1e-4 } else { 10.0 };
                if column < m {
                    q[column] += sign * step;
                } else if column < 2 * m {
                    qd[column - m] += sign * step;
                } else {
                    p[column - 2 * m] += sign * step;
                }
                let mut out = vec![0.0; m];
                forward_dynamics_into(&arm, &q, &qd, &p, None, &mut ws, &mut out);
                (out, 2.0 * step)
            };
            let ((plus, width), (minus, _)) = (at(1.0), at(-1.0));
            let exact: Vec<f64> = (0..m)
                .map(|r| if column < 2 * m { linear.state[(m + r, column)] } else { linear.input[(m + r, column - 2 *
                m)] }) .collect();
            let scale = exact.iter().fold(1e-6_f64, |s, x| s.max(x.abs()));
            for r in 0..m {
                let difference = (plus[r] - minus[r]) / width;
                prop_assert!((difference - exact[r]).abs() < 1e-5 * scale + 1e-6, "{difference} {}", exact[r]);
            }
        }
    }

    #[test]
    fn discretized_matches_the_exact_double_integrator() {
        let state = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.0, 0.0]);
        let linear = Linearization { state, input: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]) };
        let (a, b) = linear.discretized(0.1);
        assert!((a - DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 1.0])).amax() < 1e-15);
        assert!((b - DMatrix::from_row_slice(2, 1, &[0.005, 0.1])).amax() < 1e-15);
    }
}
