//! Pressures within limits from a wanted actuation force: tau = A(q) (p - p_amb), paper (53), turned round.
//!
//! min |A x - tau|^2 + eps |x - x_0|^2 for x = p - p_amb within limits, a strictly convex bounded least-squares
//! problem, by a primal active-set method (Nocedal & Wright, *Numerical Optimization*, alg. 16.3) that starts from the
//! last period's active set. eps is 1e-9 of A^T A's mean diagonal: too small to be seen in tau, it decides what tau
//! does not. x_0 is that choice: where more bellows than coordinates act, or some act on nothing, pressures tend to
//! x_0, so that a higher common pressure makes the arm stiffer (trapped air) without moving it.
//! Nothing is allocated after `new`.

use super::dense;
use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::terms::actuation_columns;
use crate::kinematics::chain::pass;
use crate::kinematics::link::Motion;

const REGULARIZATION: f64 = 1e-9;

/// Solver and its last solution.
#[derive(Clone, Debug)]
pub struct Allocation {
    /// Lowest and highest pressure of each input above ambient, Pa.
    low: Vec<f64>,
    high: Vec<f64>,
    /// The free choice, above ambient, Pa.
    preferred: Vec<f64>,
    /// -1, 0, 1: at its lowest, free, at its highest.
    bound: Vec<i8>,
    /// The solution, above ambient, Pa.
    x: Vec<f64>,
    matrix: Vec<f64>,
    unit: Vec<f64>,
    hessian: Vec<f64>,
    factor: Vec<f64>,
    gradient: Vec<f64>,
    step: Vec<f64>,
    free: Vec<usize>,
}

impl Allocation {
    /// For `arm`, with limits and preferred pressures in Pa absolute, one an input.
    pub fn new(arm: &Arm, low: &[f64], high: &[f64], preferred: &[f64]) -> Self {
        let n = arm.body.inputs;
        let above = |p: &[f64]| p.iter().map(|p| p - arm.body.ambient_pressure).collect::<Vec<_>>();
        let (low, high, preferred) = (above(low), above(high), above(preferred));
        let x = preferred.iter().zip(low.iter().zip(&high)).map(|(x, (l, h))| x.clamp(*l, *h)).collect();
        Self {
            low,
            high,
            preferred,
            bound: vec![0; n],
            x,
            matrix: vec![0.0; n * arm.coordinates()],
            unit: vec![0.0; n],
            hessian: vec![0.0; n * n],
            factor: vec![0.0; n * n],
            gradient: vec![0.0; n],
            step: vec![0.0; n],
            free: Vec::with_capacity(n),
        }
    }

    /// A(q) as evaluated last, coordinates x inputs, row by row.
    pub fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    /// Which inputs are at a limit: -1 lowest, 1 highest, 0 neither.
    pub fn at_limit(&self) -> &[i8] {
        &self.bound
    }

    /// Forgets the active set.
    pub fn reset(&mut self) {
        self.bound.fill(0);
    }

    /// The pressures for `tau` at lengths `q` into `p`, Pa absolute.
    pub fn solve(&mut self, arm: &Arm, q: &[f64], tau: &[f64], ws: &mut Workspace, p: &mut [f64]) {
        pass(&arm.body, q, &[], Motion::Pose, &mut ws.links);
        actuation_columns(arm, ws, &mut self.unit, &mut self.matrix);
        let (m, n) = (arm.coordinates(), arm.body.inputs);
        if !(m == n && self.solve_freely(tau)) {
            self.solve_bounded(m, tau);
        }
        for (p, x) in p.iter_mut().zip(&self.x) {
            *p = arm.body.ambient_pressure + x;
        }
    }

    /// The usual case, as many inputs as coordinates and no limit in the way: A x = tau itself.
    fn solve_freely(&mut self, tau: &[f64]) -> bool {
        if self.bound.iter().any(|b| *b != 0) {
            return false;
        }
        let n = self.x.len();
        self.factor.copy_from_slice(&self.matrix);
        self.step.copy_from_slice(tau);
        let inside = |((x, l), h): ((&f64, &f64), &f64)| (l..=h).contains(&x);
        if dense::eliminate(&mut self.factor, n, &mut self.step)
            && self.step.iter().zip(&self.low).zip(&self.high).all(inside)
        {
            self.x.copy_from_slice(&self.step);
            return true;
        }
        false
    }

    /// The least-squares problem, for `m` coordinates.
    fn solve_bounded(&mut self, m: usize, tau: &[f64]) {
        let n = self.x.len();
        self.gradient.fill(0.0);
        self.hessian.fill(0.0);
        for r in 0..m {
            let row = &self.matrix[r * n..(r + 1) * n];
            for i in 0..n {
                self.gradient[i] += row[i] * tau[r];
                for j in 0..=i {
                    self.hessian[i * n + j] += row[i] * row[j];
                }
            }
        }
        let mean = (0..n).map(|i| self.hessian[i * n + i]).sum::<f64>() / n as f64;
        let eps = (REGULARIZATION * mean).max(f64::MIN_POSITIVE);
        for i in 0..n {
            self.hessian[i * n + i] += eps;
            self.gradient[i] += eps * self.preferred[i];
            for j in 0..i {
                self.hessian[j * n + i] = self.hessian[i * n + j];
            }
        }
        self.minimize();
    }

    /// min 1/2 x^T H x - g^T x within limits, from the last active set.
    fn minimize(&mut self) {
        let n = self.x.len();
        for i in 0..n {
            self.x[i] = match self.bound[i] {
                -1 => self.low[i],
                1 => self.high[i],
                _ => self.x[i].clamp(self.low[i], self.high[i]),
            };
        }
        // Each pass binds or frees one input; a strictly convex problem ends well before this.
        for _ in 0..6 * n + 6 {
            self.free.clear();
            self.free.extend((0..n).filter(|&i| self.bound[i] == 0));
            let length = self.newton_step();
            if length < 1.0 {
                continue;
            }
            // At the minimum of the face: free the input whose limit is pushed away from most.
            let mut worst = (0.0, usize::MAX);
            for i in 0..n {
                if self.bound[i] != 0 {
                    let row = &self.hessian[i * n..(i + 1) * n];
                    let slope = row.iter().zip(&self.x).map(|(h, x)| h * x).sum::<f64>() - self.gradient[i];
                    let pull = slope * f64::from(self.bound[i]);
                    let scale = self.hessian[i * n + i] * (self.high[i] - self.low[i]);
                    if pull > 1e-12 * scale && pull > worst.0 {
                        worst = (pull, i);
                    }
                }
            }
            if worst.1 == usize::MAX {
                return;
            }
            self.bound[worst.1] = 0;
        }
    }

    /// Goes from `x` towards the minimum over the free inputs until the first limit, which is bound; returns how much
    /// of the way.
    fn newton_step(&mut self) -> f64 {
        let (n, f) = (self.x.len(), self.free.len());
        if f == 0 {
            return 1.0;
        }
        for (a, &i) in self.free.iter().enumerate() {
            let row = &self.hessian[i * n..(i + 1) * n];
            self.step[a] = self.gradient[i] - row.iter().zip(&self.x).map(|(h, x)| h * x).sum::<f64>();
            for (b, &j) in self.free.iter().enumerate() {
                self.factor[a * f + b] = row[j];
            }
        }
        if !dense::factorize(&mut self.factor[..f * f], f) {
            return 1.0;
        }
        dense::solve(&self.factor[..f * f], f, &mut self.step[..f]);
        let (mut length, mut first) = (1.0, None);
        for (a, &i) in self.free.iter().enumerate() {
            let d = self.step[a];
            let room = if d > 0.0 { self.high[i] - self.x[i] } else { self.low[i] - self.x[i] };
            if d != 0.0 && room / d < length {
                (length, first) = (room / d, Some((i, if d > 0.0 { 1 } else { -1 })));
            }
        }
        for (a, &i) in self.free.iter().enumerate() {
            self.x[i] += length * self.step[a];
        }
        if let Some((i, side)) = first {
            self.bound[i] = side;
            self.x[i] = if side > 0 { self.high[i] } else { self.low[i] };
        }
        length
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::{arms, states};
    use crate::dynamics::terms::generalized_force_into;
    use crate::forces::ForceSet;
    use proptest::prelude::*;

    fn actuation(arm: &Arm, q: &[f64], p: &[f64]) -> Vec<f64> {
        let mut tau = vec![0.0; arm.coordinates()];
        let set = ForceSet { actuation: true, ..ForceSet::NONE };
        generalized_force_into(arm, set, (q, &[]), p, None, &mut Workspace::new(arm), &mut tau);
        tau
    }

    proptest! {
        /// Where the wanted force can be had, it is had, and the pressures are those it came from.
        #[test]
        fn undoes_the_actuation(arm in arms(), seed in states()) {
            let (q, p) = (seed.lengths(&arm), seed.pressures(&arm));
            let tau = actuation(&arm, &q, &p);
            let n = arm.body.inputs;
            let mut allocation = Allocation::new(&arm, &vec![0.5e5; n], &vec![3e5; n], &vec![1.2e5; n]);
            let mut found = vec![0.0; n];
            allocation.solve(&arm, &q, &tau, &mut Workspace::new(&arm), &mut found);
            let again = actuation(&arm, &q, &found);
            for k in 0..n {
                prop_assert!((again[k] - tau[k]).abs() < 1e-2, "{} {}", again[k], tau[k]);
            }
            prop_assert!(allocation.at_limit().iter().all(|b| *b == 0));
        }

        /// Optimality (Karush, Kuhn, Tucker) where limits bind, from the last solution and from a fresh start alike.
        #[test]
        fn optimal_within_limits(arm in arms(), seed in states(), scale in 0.5..3.0_f64) {
            let (q, p) = (seed.lengths(&arm), seed.pressures(&arm));
            let wanted: Vec<f64> = p.iter().map(|p| 1.2e5 + scale * (p - 1.2e5)).collect();
            let tau = actuation(&arm, &q, &wanted);
            let n = arm.body.inputs;
            let (low, high) = (0.9e5, 1.6e5);
            let mut allocation = Allocation::new(&arm, &vec![low; n], &vec![high; n], &vec![1.2e5; n]);
            let mut ws = Workspace::new(&arm);
            let (mut found, mut again) = (vec![0.0; n], vec![0.0; n]);
            allocation.solve(&arm, &q, &vec![0.0; n], &mut ws, &mut found);
            allocation.solve(&arm, &q, &tau, &mut ws, &mut found);
            allocation.reset();
            allocation.solve(&arm, &q, &tau, &mut ws, &mut again);
            let left: Vec<f64> = actuation(&arm, &q, &found).iter().zip(&tau).map(|(a, b)| a - b).collect();
            let size = tau.iter().fold(1.0_f64, |m, x| m.max(x.abs()));
            for j in 0..n {
                prop_assert!(found[j] >= low - 1e-9 && found[j] <= high + 1e-9);
                prop_assert!((found[j] - again[j]).abs() < 100.0, "{} {}", found[j], again[j]);
                let column = (0..n).map(|r| allocation.matrix()[r * n + j]);
                let slope: f64 = column.clone().zip(&left).map(|(a, r)| a * r).sum();
                let unit: f64 = column.map(|a| a * a).sum::<f64>().sqrt();
                let tolerance = 1e-4 * unit * size;
                match allocation.at_limit()[j] {
                    1 => prop_assert!(slope < tolerance, "{slope}"),
                    -1 => prop_assert!(slope > -tolerance, "{slope}"),
                    _ => prop_assert!(slope.abs() < tolerance, "{slope}"),
                }
            }
        }
    }
}
