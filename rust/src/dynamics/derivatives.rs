//! Exact derivatives of forward dynamics by state, pressures and any numbers of the arm.
//!
//! Source: forward-mode automatic differentiation of (48) as `recursion` solves it; nothing is differentiated by hand.
//! One pass takes a block of directions, so that the arm's values are computed once for all of them.
//! Limits: those of the model; at kinks of one-sided laws the derivative of the side that is taken.

use super::Workspace;
use super::recursion::forward_dynamics_into;
use crate::abreast::with_tangents;
use crate::arm::Arm;
use crate::effects;
use crate::linear::Vec3;
#[cfg(all(feature = "lanes", target_arch = "x86_64"))]
use crate::real::lanes::Avx2;
#[cfg(all(feature = "lanes", target_arch = "aarch64"))]
use crate::real::lanes::Neon;
use crate::real::{Dual, Real};
#[cfg(feature = "lanes")]
use crate::real::{InstructionSet, Lanes};
use std::fmt::Debug;

/// One state to differentiate at.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// Lengths, m.
    pub q: &'a [f64],
    /// Their rates, m/s.
    pub qd: &'a [f64],
    /// Pressures, Pa absolute; effects on pressures are at rest under them.
    pub p: &'a [f64],
    /// Force at each section's centre of mass in the base frame, N.
    pub f_ext: Option<&'a [Vec3<f64>]>,
}

/// Takes derivatives of one arm's forward dynamics. Nothing is allocated after [`differentiator`].
pub trait Differentiator: Send + Debug {
    /// q'' into `qdd` and its derivatives into `out`, one row of 3n a direction: by q, by q', by the pressures, along the
    /// arm's tangents.
    fn run(&mut self, at: Point<'_>, qdd: &mut [f64], out: &mut [f64]);
}

/// Of `arm` by state and pressures and along `tangents` (derivatives of its numbers, see [`crate::abreast::tangent`]).
///
/// Four directions a pass: in the lanes of one register, where the processor has registers for four, else in the dual number.
pub fn differentiator(arm: &Arm, tangents: &[Vec<f64>]) -> Box<dyn Differentiator> {
    #[cfg(all(feature = "lanes", target_arch = "x86_64"))]
    if InstructionSet::Avx2.is_available() {
        return Box::new(Lifted::<1, Lanes<Avx2>>::new(arm, tangents));
    }
    #[cfg(all(feature = "lanes", target_arch = "aarch64"))]
    if InstructionSet::Neon.is_available() {
        return Box::new(Lifted::<1, Lanes<Neon>>::new(arm, tangents));
    }
    Box::new(Lifted::<4, f64>::new(arm, tangents))
}

/// The arm over dual numbers, with its work space.
#[derive(Debug)]
struct Lifted<const N: usize, T> {
    /// Without derivatives, and one for each block of tangents.
    plain: Arm<Dual<N, T>>,
    tangents: Vec<Arm<Dual<N, T>>>,
    tangent_count: usize,
    ws: Workspace<Dual<N, T>>,
    /// q, q', p, one after the other.
    x: Vec<Dual<N, T>>,
    forces: Vec<Vec3<Dual<N, T>>>,
    /// The pressures that act.
    acting: Vec<Dual<N, T>>,
    qdd: Vec<Dual<N, T>>,
}

impl<const N: usize, T: Real> Lifted<N, T> {
    /// Directions a pass.
    const WIDTH: usize = N * T::LANES;

    fn new(arm: &Arm, tangents: &[Vec<f64>]) -> Self {
        let plain = arm.lift();
        let blocks = tangents.chunks(Self::WIDTH);
        let tangent_arms =
            blocks.map(|b| with_tangents(arm, &b.iter().map(Vec::as_slice).collect::<Vec<_>>())).collect();
        let n = arm.coordinates();
        let zero = Dual::zero();
        Self {
            ws: Workspace::new(&plain),
            plain,
            tangents: tangent_arms,
            tangent_count: tangents.len(),
            x: vec![zero; 2 * n + arm.inputs],
            forces: vec![Vec3::zero(); arm.sections.len()],
            acting: vec![zero; arm.inputs],
            qdd: vec![zero; n],
        }
    }

    /// One pass with the derivatives now in `x` and those of the given arm.
    fn pass(&mut self, tangent: Option<usize>, forces: bool) {
        let arm = tangent.map_or(&self.plain, |k| &self.tangents[k]);
        let (q, rest) = self.x.split_at(self.qdd.len());
        let (qd, p) = rest.split_at(self.qdd.len());
        self.acting.copy_from_slice(p);
        effects::pressures::at_rest(arm, &mut self.acting);
        let (p, f_ext) = (self.acting.as_slice(), forces.then_some(self.forces.as_slice()));
        forward_dynamics_into(arm, q, qd, p, f_ext, &mut self.ws, &mut self.qdd);
    }

    /// Rows of the block's first `count` directions.
    fn store(&self, count: usize, out: &mut [f64]) {
        for (d, row) in out.chunks_mut(self.qdd.len()).take(count).enumerate() {
            for (to, from) in row.iter_mut().zip(&self.qdd) {
                *to = from.along(d);
            }
        }
    }
}

impl<const N: usize, T: Real> Differentiator for Lifted<N, T> {
    fn run(&mut self, at: Point<'_>, qdd: &mut [f64], out: &mut [f64]) {
        let n = qdd.len();
        for (to, from) in self.x.iter_mut().zip(at.q.iter().chain(at.qd).chain(at.p)) {
            *to = Dual::from_f64(*from);
        }
        if let Some(f) = at.f_ext {
            for (to, from) in self.forces.iter_mut().zip(f) {
                *to = Vec3::from_f64(from.0);
            }
        }
        let forces = at.f_ext.is_some();
        let states = self.x.len();
        for first in (0..states).step_by(Self::WIDTH) {
            let count = Self::WIDTH.min(states - first);
            for d in 0..count {
                let x = &mut self.x[first + d];
                *x = Dual::seeded(x.value.lane(0), |k| f64::from(k == d));
            }
            self.pass(None, forces);
            self.store(count, &mut out[first * n..]);
            for x in &mut self.x[first..first + count] {
                *x = Dual::from_f64(x.value.lane(0));
            }
        }
        for (to, from) in qdd.iter_mut().zip(&self.qdd) {
            *to = from.value.lane(0);
        }
        for block in 0..self.tangents.len() {
            let first = block * Self::WIDTH;
            self.pass(Some(block), forces);
            self.store(Self::WIDTH.min(self.tangent_count - first), &mut out[(states + first) * n..]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::testing::{arms, states};
    use proptest::prelude::*;

    fn forward(arm: &Arm, x: &[f64]) -> Vec<f64> {
        let n = arm.coordinates();
        let mut out = vec![0.0; n];
        let mut ws = Workspace::new(arm);
        let (q, qd, p) = (&x[..n], &x[n..2 * n], &x[2 * n..]);
        crate::dynamics::recursion::forward_dynamics_into(arm, q, qd, p, None, &mut ws, &mut out);
        out
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]
        /// Differences of order 8, by state, pressures and mass.
        #[test]
        fn agree_with_differences(arm in arms(), seed in states()) {
            let n = arm.coordinates();
            let (q, qd, p) = (seed.lengths(&arm), seed.rates(&arm), seed.pressures(&arm));
            let x: Vec<f64> = q.iter().chain(&qd).chain(&p).copied().collect();
            let heavier = |m: f64| {
                let mut other = arm.clone();
                other.sections[0].mass = m;
                other
            };
            let mass = arm.sections[0].mass;
            let (a, b) = (heavier(2.0 * mass), heavier(mass));
            let tangents = vec![crate::abreast::tangent(&[&a, &b], &[1.0 / mass, -1.0 / mass]).unwrap()];
            const WEIGHTS: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
            let difference = |f: &dyn Fn(f64) -> Vec<f64>, h: f64| {
                let mut sum = vec![0.0; n];
                for (k, w) in WEIGHTS.into_iter().enumerate() {
                    let step = h * (k as f64 + 1.0);
                    for (s, (a, b)) in sum.iter_mut().zip(f(step).into_iter().zip(f(-step))) {
                        *s += w * (a - b) / h;
                    }
                }
                sum
            };
            let (mut qdd, mut out) = (vec![0.0; n], vec![0.0; n * (x.len() + 1)]);
                differentiator(&arm, &tangents).run(Point { q: &q, qd: &qd, p: &p, f_ext: None }, &mut qdd, &mut out);
                let plain = forward(&arm, &x);
                let size = plain.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
                prop_assert!(plain.iter().zip(&qdd).all(|(a, b)| (a - b).abs() < 1e-11 * size));
                for (d, row) in out.chunks(n).enumerate() {
                    let h = if d < n { 1e-3 } else if d < 2 * n { 1e-2 } else if d < x.len() { 1e3 } else { 1e-2 * mass };
                    let moved = |e: f64| {
                        let mut y = x.clone();
                        if d < x.len() {
                            y[d] += e;
                            forward(&arm, &y)
                        } else {
                            forward(&heavier(mass + e), &y)
                        }
                    };
                    let expected = difference(&moved, h);
                    let size = row.iter().fold(size * 1e-3 / h, |m, v| m.max(v.abs()));
                    for (found, expected) in row.iter().zip(&expected) {
                        prop_assert!((found - expected).abs() < 1e-8 * size, "{d}: {found} {expected}");
                    }
                }

        }
    }
}
