//! Lengths from a wanted tip: position, and direction if wanted, with what is left over used to stay within the
//! lengths.
//!
//! Resolved motion (Whitney 1969) with the redundancy in the null space (Liegeois, IEEE Trans. SMC 7 (1977) 868):
//! dq = J^+ dx - (1 - J^+ J) k grad H, H = 1/2 sum ((q - middle) / half range)^2, by damped least squares
//! (Nakamura & Hanafusa 1986) so that it stays bounded at singular poses. Positions are iterated to convergence at each
//! sample, so that nothing drifts.
//! Frame: the world's. The direction is that of the tip's z axis.

use super::dense;
use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::kinematics::chain::pass;
use crate::kinematics::link::{Link, Motion};
use crate::kinematics::point::{Point, jacobian, pose};
use crate::real::linear::Vec3;

/// Tip error accepted, m (and rad for the direction).
const TOLERANCE: f64 = 1e-9;
const MAX_ITERATIONS: usize = 200;
/// Largest change of a length in one iteration, m.
const MAX_STEP: f64 = 0.02;
/// Damping of the least squares, of J J^T's mean diagonal.
const DAMPING: f64 = 1e-10;
/// Part of the way to the middle of the lengths that an iteration goes in the null space.
const CENTERING: f64 = 0.5;

/// A wanted tip.
#[derive(Clone, Copy, Debug)]
pub struct Tip {
    /// Position, m.
    pub position: Vec3<f64>,
    /// Direction of the z axis, of length 1, if wanted.
    pub direction: Option<Vec3<f64>>,
}

/// Solver with its work space.
#[derive(Clone, Debug)]
pub struct ResolvedMotion {
    point: Point<f64>,
    /// Middle and half range of each length, m.
    middle: Vec<f64>,
    half: Vec<f64>,
    links: Vec<Link<f64>>,
    columns: Vec<[Vec3<f64>; 2]>,
    /// Task rows x coordinates.
    rows: Vec<f64>,
    step: Vec<f64>,
    back: Vec<f64>,
}

impl ResolvedMotion {
    /// For a point of `arm` (its tip: the last section's head with an offset) and the range of each length.
    pub fn new(arm: &Arm, offset: Vec3<f64>, low: &[f64], high: &[f64]) -> Self {
        let m = arm.coordinates();
        Self {
            point: Point { section: arm.body.sections.len() - 1, fraction: 1.0, offset },
            middle: low.iter().zip(high).map(|(l, h)| 0.5 * (l + h)).collect(),
            half: low.iter().zip(high).map(|(l, h)| 0.5 * (h - l)).collect(),
            links: vec![Link::base(); arm.body.sections.len()],
            columns: vec![[Vec3::zero(); 2]; m],
            rows: vec![0.0; 6 * m],
            step: vec![0.0; m],
            back: vec![0.0; m],
        }
    }

    /// Moves `q` until its tip is `tip`, and as near to the middle of the lengths as the tip leaves free to.
    ///
    /// # Errors
    /// [`Error::Convergence`] with the distance left where the tip cannot be reached, or not within the lengths.
    pub fn solve(&mut self, arm: &Arm, tip: &Tip, q: &mut [f64]) -> Result<()> {
        let mut left = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            let (error, size) = self.linearize(arm, tip, q);
            left = size;
            let moved = self.newton(arm, &error, tip, q)?;
            if size < TOLERANCE && moved < 1e-9 {
                let outside = (0..q.len()).find(|&k| (q[k] - self.middle[k]).abs() > self.half[k] * (1.0 + 1e-9));
                return match outside {
                    None => Ok(()),
                    Some(k) => Err(Error::Convergence(format!(
                        "the tip {:?} is reached only with length {} of section {} at {:.4} m, outside {:.4} to {:.4}
                        m",
                        tip.position.0,
                        k % 3 + 1,
                        k / 3 + 1,
                        q[k],
                        self.middle[k] - self.half[k],
                        self.middle[k] + self.half[k]
                    ))),
                };
            }
        }
        if left < 1e3 * TOLERANCE {
            return Ok(());
        }
        Err(Error::Convergence(format!(
            "the tip {:?} is not reached: {:.3e} m is left; choose one within the arm's reach",
            tip.position.0, left
        )))
    }

    /// Task Jacobian into `rows`; returns the error and its size.
    fn linearize(&mut self, arm: &Arm, tip: &Tip, q: &[f64]) -> ([f64; 6], f64) {
        pass(&arm.body, q, &[], Motion::Pose, &mut self.links);
        let (rotation, position) = pose(&arm.body, &self.links, &self.point);
        jacobian(&arm.body, &self.links, &self.point, &mut self.columns);
        let m = q.len();
        let off = tip.position - position;
        let mut error = [off.0[0], off.0[1], off.0[2], 0.0, 0.0, 0.0];
        let z = rotation.column(2);
        for (k, column) in self.columns.iter().enumerate() {
            for r in 0..3 {
                self.rows[r * m + k] = column[0].0[r];
            }
            if tip.direction.is_some() {
                let turned = column[1].cross(z);
                for r in 0..3 {
                    self.rows[(3 + r) * m + k] = turned.0[r];
                }
            }
        }
        if let Some(direction) = tip.direction {
            error[3..].copy_from_slice(&(direction - z).0);
        }
        (error, error.iter().fold(0.0, |s, e| s.max(e.abs())))
    }

    /// One iteration; returns the largest change of a length.
    fn newton(&mut self, arm: &Arm, error: &[f64; 6], tip: &Tip, q: &mut [f64]) -> Result<f64> {
        let m = arm.coordinates();
        let t = if tip.direction.is_some() { 6 } else { 3 };
        let mut gram = [0.0; 36];
        for i in 0..t {
            for j in 0..t {
                let (a, b) = (&self.rows[i * m..(i + 1) * m], &self.rows[j * m..(j + 1) * m]);
                gram[i * t + j] = a.iter().zip(b).map(|(a, b)| a * b).sum();
            }
        }
        // A direction has two degrees of freedom in three rows: the damping also makes up for the missing rank.
        let damping = DAMPING.max(if t == 6 { 1e-9 } else { 0.0 }) * (0..t).map(|i| gram[i * t + i]).sum::<f64>();
        for i in 0..t {
            gram[i * t + i] += damping.max(f64::MIN_POSITIVE);
        }
        if !dense::factorize(&mut gram[..t * t], t) {
            return Err(Error::Convergence("the tip's Jacobian is singular".to_owned()));
        }
        for k in 0..m {
            let pull = (self.middle[k] - q[k]) * CENTERING;
            self.back[k] = pull;
            self.step[k] = pull;
        }
        // step = back + J^+ (error - J back).
        let mut wanted = [0.0; 6];
        for i in 0..t {
            let row = &self.rows[i * m..(i + 1) * m];
            wanted[i] = error[i] - row.iter().zip(&self.back).map(|(a, b)| a * b).sum::<f64>();
        }
        dense::solve(&gram[..t * t], t, &mut wanted[..t]);
        for k in 0..m {
            for i in 0..t {
                self.step[k] += self.rows[i * m + k] * wanted[i];
            }
        }
        let largest = self.step.iter().fold(0.0_f64, |s, x| s.max(x.abs()));
        let scale = if largest > MAX_STEP { MAX_STEP / largest } else { 1.0 };
        for (q, s) in q.iter_mut().zip(&self.step) {
            *q += scale * s;
        }
        Ok(largest * scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::{arms, plain_arm_parameters, states};
    use proptest::prelude::*;

    proptest! {
        /// Any tip that some pose within the lengths has is reached from the middle: by arms of one arc a section. Arcs that
        /// bend against each other make creases in the tip's path, where the search from one start may end.
        #[test]
        fn reaches_what_is_reachable(parameters in plain_arm_parameters(), seed in states()) {
            prop_assume!(parameters.section.len() >= 2);
            let arm = Arm::new(&parameters).unwrap();
            let m = arm.coordinates();
            let goal: Vec<f64> = seed.lengths(&arm).iter().map(|q| 0.2 + 0.4 * (q - 0.2)).collect();
            let mut links = vec![Link::base(); arm.body.sections.len()];
            pass(&arm.body, &goal, &[], Motion::Pose, &mut links);
            let tip = Tip { position: links[arm.body.sections.len() - 1].position, direction: None };
            let mut solver = ResolvedMotion::new(&arm, Vec3::zero(), &vec![0.02; m], &vec![0.38; m]);
            let mut q = vec![0.2; m];
            solver.solve(&arm, &tip, &mut q).unwrap();
            pass(&arm.body, &q, &[], Motion::Pose, &mut links);
            let off = links[arm.body.sections.len() - 1].position - tip.position;
            prop_assert!(off.dot(off).sqrt() < 1e-6);
            // The redundancy is used: no farther from the middle than the pose it came from.
            let distance = |q: &[f64]| q.iter().map(|q| (q - 0.2).powi(2)).sum::<f64>();
            prop_assert!(distance(&q) <= distance(&goal) + 1e-9);
        }
    }

    #[test]
    fn out_of_reach_is_an_error() {
        let mut runner = proptest::test_runner::TestRunner::deterministic();
        let arm = proptest::strategy::ValueTree::current(&arms().new_tree(&mut runner).unwrap());
        let m = arm.coordinates();
        let mut solver = ResolvedMotion::new(&arm, Vec3::zero(), &vec![0.1; m], &vec![0.3; m]);
        let tip = Tip { position: Vec3([9.0, 0.0, 0.0]), direction: None };
        assert!(matches!(solver.solve(&arm, &tip, &mut vec![0.2; m]), Err(Error::Convergence(_))));
    }
}
