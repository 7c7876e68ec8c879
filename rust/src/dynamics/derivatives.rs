//! Exact derivatives of forward dynamics by state, pressures and any numbers of the arm.
//!
//! Source: at the accelerations q'' that solve (48) the residual r = tau - M q'' - C q' - N is zero, so that
//! d q''/dx = M^-1 dr/dx with q'' held: r needs no solution of (48), and M is factored once, in ordinary numbers. This is
//! what hand-written derivatives rest on, too (Carpentier & Mansard, *Analytical Derivatives of Rigid Body Dynamics
//! Algorithms*, RSS 2018, (4)); but dr/dx is forward-mode automatic differentiation of the model: nothing is
//! differentiated by hand.
//! One pass takes the coordinates and rates of one section. Sections below do not move with them, and sections above only
//! as bodies: what these are by themselves ([`Local`]) has no derivative.
//! Limits: those of the model; at kinks of one-sided laws the derivative of the side that is taken.

use super::Workspace;
use super::applied::accumulate;
use super::recursion::{Inertial, inertia_forces, left_over, motion_needed, solve};
use super::terms::inertia_matrix_of;
use crate::arm::Arm;
use crate::arm::structure::with_tangents;
use crate::effects;
use crate::forces::{External, ForceSet, PointWrench, Wrench};
use crate::kinematics::chain::{pass_again, pass_masses};
use crate::kinematics::link::{Link, Local};
#[cfg(feature = "lanes")]
use crate::real::Lanes;
#[cfg(all(feature = "lanes", target_arch = "aarch64"))]
use crate::real::lanes::Neon;
#[cfg(all(feature = "lanes", target_arch = "x86_64"))]
use crate::real::lanes::{Avx2, Avx512};
use crate::real::linear::Vec3;
use crate::real::{Dual, InstructionSet, Kernel, Real};
use std::fmt::Debug;
use std::ops::Range;

/// One state to differentiate at.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a> {
    /// Lengths, m.
    pub q: &'a [f64],
    /// Their rates, m/s.
    pub qd: &'a [f64],
    /// Pressures, Pa absolute; effects on pressures are at rest under them.
    pub p: &'a [f64],
    /// What acts from outside.
    pub f_ext: Option<External<'a, f64>>,
}

/// Takes derivatives of one arm's forward dynamics. Nothing is allocated after [`differentiator`].
pub trait Differentiator: Send + Debug {
    /// q'' into `qdd` and its derivatives into `out`, one row of 3n a direction: by q, by q', by the pressures, along the
    /// arm's tangents.
    fn run(&mut self, at: Point<'_>, qdd: &mut [f64], out: &mut [f64]);
}

/// Of `arm` by state and pressures and along `tangents` (derivatives of its numbers, see [`crate::arm::structure::tangent`]).
///
/// Eight directions a pass, where `set` has registers for them (and the processor has `set`), else four in ordinary
/// numbers.
pub fn differentiator(arm: &Arm, tangents: &[Vec<f64>], set: InstructionSet) -> Box<dyn Differentiator> {
    match set {
        #[cfg(all(feature = "lanes", target_arch = "x86_64"))]
        InstructionSet::Avx512 if set.is_available() => Box::new(Lifted::<1, Lanes<Avx512>>::new(arm, tangents)),
        #[cfg(all(feature = "lanes", target_arch = "x86_64"))]
        InstructionSet::Avx2 if set.is_available() => Box::new(Lifted::<2, Lanes<Avx2>>::new(arm, tangents)),
        #[cfg(all(feature = "lanes", target_arch = "aarch64"))]
        InstructionSet::Neon if set.is_available() => Box::new(Lifted::<2, Lanes<Neon>>::new(arm, tangents)),
        _ => Box::new(Lifted::<4, f64>::new(arm, tangents)),
    }
}

/// The arm in ordinary and in dual numbers, with work space for both.
#[derive(Debug)]
struct Lifted<const N: usize, T> {
    plain: Plain,
    /// Without derivatives, and one for each block of tangents.
    arm: Arm<Dual<N, T>>,
    tangents: Vec<Arm<Dual<N, T>>>,
    tangent_count: usize,
    ws: Workspace<Dual<N, T>>,
    locals: Vec<Local<Dual<N, T>>>,
    q: Vec<Dual<N, T>>,
    qd: Vec<Dual<N, T>>,
    qdd: Vec<Dual<N, T>>,
    p: Vec<Dual<N, T>>,
    forces: Vec<Vec3<Dual<N, T>>>,
    wrenches: Vec<PointWrench<Dual<N, T>>>,
    /// The pressures that act.
    acting: Vec<Dual<N, T>>,
    residual: Vec<Dual<N, T>>,
    /// Right-hand sides of one block of lanes.
    column: Vec<T>,
}

/// The motion without derivatives.
#[derive(Debug)]
struct Plain {
    arm: Arm,
    ws: Workspace,
    locals: Vec<Local<f64>>,
    acting: Vec<f64>,
    /// M = L L^T: L row by row, its diagonal inverted.
    factor: Vec<f64>,
}

impl Plain {
    fn new(arm: &Arm) -> Self {
        let n = arm.coordinates();
        let locals = vec![Local::zero(); arm.body.sections.len()];
        let (acting, factor) = (vec![0.0; arm.body.inputs], vec![0.0; n * n]);
        Self { arm: arm.clone(), ws: Workspace::new(arm), locals, acting, factor }
    }

    /// Forward dynamics into `qdd`, with all that passes with derivatives start from.
    fn run(&mut self, at: Point<'_>, qdd: &mut [f64]) {
        let Self { arm, ws, locals, acting, factor } = self;
        acting.copy_from_slice(at.p);
        effects::pressures::at_rest(&arm.effects, acting);
        pass_again(&arm.body, at.q, at.qd, motion_needed(arm), 0..arm.body.sections.len(), locals, &mut ws.links);
        pass_masses(&arm.body, &ws.links, 0, motion_needed(arm), &mut ws.masses);
        accumulate(arm, ForceSet::ALL, acting, at.f_ext, &ws.links, &ws.masses, &mut ws.effects, &mut ws.loads);
        solve(arm, ws, qdd);
        inertia_forces(arm, qdd, 0, &ws.links, &ws.masses, &mut ws.inertial, &mut ws.mass_wrenches);
        inertia_matrix_of(arm, &ws.links, &ws.masses, factor);
        cholesky(qdd.len(), factor);
    }
}

/// L of the symmetric, positive definite `n` x `n` matrix L L^T, in place, row by row; its diagonal inverted.
fn cholesky(n: usize, matrix: &mut [f64]) {
    for i in 0..n {
        let (above, row) = matrix.split_at_mut(i * n);
        for j in 0..=i {
            let other = if j < i { &above[j * n..j * n + j] } else { &[] };
            let mut sum = row[j];
            for (k, l) in other.iter().enumerate() {
                sum -= row[k] * l;
            }
            if j < i {
                row[j] = sum * above[j * n + j];
            } else {
                sum -= row[..i].iter().map(|l| l * l).sum::<f64>();
                row[i] = sum.sqrt().recip();
            }
        }
    }
}

/// Solves L L^T x = b in place, `factor` as [`cholesky`] leaves it.
#[inline(always)]
fn substitute<T: Real>(factor: &[f64], x: &mut [T]) {
    let n = x.len();
    for i in 0..n {
        let mut sum = x[i];
        for j in 0..i {
            sum = x[j].neg_mul_add(T::from_f64(factor[i * n + j]), sum);
        }
        x[i] = sum * factor[i * n + i];
    }
    for i in (0..n).rev() {
        let mut sum = x[i];
        for j in i + 1..n {
            sum = x[j].neg_mul_add(T::from_f64(factor[j * n + i]), sum);
        }
        x[i] = sum * factor[i * n + i];
    }
}

impl<const N: usize, T: Real> Lifted<N, T> {
    /// Directions a pass.
    const WIDTH: usize = N * T::LANES;

    fn new(arm: &Arm, tangents: &[Vec<f64>]) -> Self {
        let lifted = arm.lift();
        let blocks = tangents.chunks(Self::WIDTH);
        let tangent_arms =
            blocks.map(|b| with_tangents(arm, &b.iter().map(Vec::as_slice).collect::<Vec<_>>())).collect();
        let (n, sections, zero) = (arm.coordinates(), arm.body.sections.len(), Dual::zero());
        Self {
            plain: Plain::new(arm),
            ws: Workspace::new(&lifted),
            arm: lifted,
            tangents: tangent_arms,
            tangent_count: tangents.len(),
            locals: vec![Local::zero(); sections],
            q: vec![zero; n],
            qd: vec![zero; n],
            qdd: vec![zero; n],
            p: vec![zero; arm.body.inputs],
            forces: Vec::with_capacity(sections),
            wrenches: Vec::new(),
            acting: vec![zero; arm.body.inputs],
            residual: vec![zero; n],
            column: vec![T::zero(); n],
        }
    }

    /// All numbers of the motion as they are in `plain`, without derivatives.
    #[inline(always)]
    fn lift(&mut self, at: Point<'_>, qdd: &[f64]) {
        let Self { plain, ws, locals, .. } = self;
        for (to, from) in [(&mut self.q, at.q), (&mut self.qd, at.qd), (&mut self.qdd, qdd), (&mut self.p, at.p)] {
            for (to, from) in to.iter_mut().zip(from) {
                *to = Dual::from_f64(*from);
            }
        }
        // As long as those given, so that nothing is allocated from the second time on.
        let outside = at.f_ext.unwrap_or(External { forces: &[], wrenches: &[] });
        self.forces.clear();
        for from in outside.forces {
            self.forces.push(Vec3::from_f64(from.0));
        }
        self.wrenches.clear();
        for from in outside.wrenches {
            self.wrenches.push(PointWrench::lifted(from));
        }
        for i in 0..locals.len() {
            locals[i] = Local::lifted(&plain.locals[i]);
            ws.links[i] = Link::lifted(&plain.ws.links[i]);
            ws.inertial[i] = Inertial::lifted(&plain.ws.inertial[i]);
        }
        for k in 0..ws.masses.len() {
            ws.masses[k] = Link::lifted(&plain.ws.masses[k]);
            ws.mass_wrenches[k] = Wrench::lifted(&plain.ws.mass_wrenches[k]);
        }
        self.act(None);
    }

    /// The pressures that act under those in `p`.
    #[inline(always)]
    fn act(&mut self, tangent: Option<usize>) {
        let arm = tangent.map_or(&self.arm, |k| &self.tangents[k]);
        self.acting.copy_from_slice(&self.p);
        effects::pressures::at_rest(&arm.effects, &mut self.acting);
    }

    /// The residual, with the derivatives now in the coordinates of the sections `own`.
    #[inline(always)]
    fn pass(&mut self, tangent: Option<usize>, set: ForceSet, own: Range<usize>) {
        let arm = tangent.map_or(&self.arm, |k| &self.tangents[k]);
        let (ws, from) = (&mut self.ws, own.start);
        if !own.is_empty() {
            pass_again(&arm.body, &self.q, &self.qd, motion_needed(arm), own, &mut self.locals, &mut ws.links);
            pass_masses(&arm.body, &ws.links, from, motion_needed(arm), &mut ws.masses);
            inertia_forces(arm, &self.qdd, from, &ws.links, &ws.masses, &mut ws.inertial, &mut ws.mass_wrenches);
        }
        let outside = Some(External { forces: &self.forces, wrenches: &self.wrenches });
        accumulate(arm, set, &self.acting, outside, &ws.links, &ws.masses, &mut ws.effects, &mut ws.loads);
        let (inertial, wrenches) = (&ws.inertial, &ws.mass_wrenches);
        left_over(arm, &ws.links, &ws.masses, &mut ws.loads, inertial, wrenches, &mut self.residual);
    }

    /// Rows `row(d)` of `out` for the pass's first `count` directions `d`.
    #[inline(always)]
    fn store(&mut self, count: usize, row: impl Fn(usize) -> usize, out: &mut [f64]) {
        let n = self.residual.len();
        for j in 0..N {
            for (to, from) in self.column.iter_mut().zip(&self.residual) {
                *to = from.derivative[j];
            }
            substitute(&self.plain.factor, &mut self.column);
            for k in 0..T::LANES.min(count.saturating_sub(j * T::LANES)) {
                let first = row(j * T::LANES + k) * n;
                for (to, from) in out[first..first + n].iter_mut().zip(&self.column) {
                    *to = from.lane(k);
                }
            }
        }
    }

    #[inline(always)]
    fn derivatives(&mut self, at: Point<'_>, qdd: &[f64], out: &mut [f64]) {
        let (n, inputs, sections) = (self.q.len(), self.p.len(), self.locals.len());
        let set = ForceSet { external: at.f_ext.is_some(), ..ForceSet::ALL };
        self.lift(at, qdd);
        // Pressures move nothing at the moment.
        for first in (0..inputs).step_by(Self::WIDTH) {
            let count = Self::WIDTH.min(inputs - first);
            for j in 0..inputs {
                self.p[j] = Dual::seeded(at.p[j], |d| f64::from(first + d == j));
            }
            self.act(None);
            let set = ForceSet { actuation: true, effects: true, ..ForceSet::NONE };
            self.pass(None, set, 0..0);
            self.store(count, |d| 2 * n + first + d, out);
        }
        for j in 0..inputs {
            self.p[j] = Dual::from_f64(at.p[j]);
        }
        self.act(None);
        // From the last section down: those below one that moves are as lifted.
        for i in (0..sections).rev() {
            for first in (0..6).step_by(Self::WIDTH) {
                for j in 0..3 {
                    let k = 3 * i + j;
                    self.q[k] = Dual::seeded(at.q[k], |d| f64::from(first + d == j));
                    self.qd[k] = Dual::seeded(at.qd[k], |d| f64::from(first + d == j + 3));
                }
                self.pass(None, set, i..i + 1);
                let row = |d: usize| if first + d < 3 { 3 * i + first + d } else { n + 3 * i + first + d - 3 };
                self.store(Self::WIDTH.min(6 - first), row, out);
            }
            for k in 3 * i..3 * i + 3 {
                (self.q[k], self.qd[k]) = (Dual::from_f64(at.q[k]), Dual::from_f64(at.qd[k]));
            }
            self.locals[i] = Local::lifted(&self.plain.locals[i]);
        }
        for block in 0..self.tangents.len() {
            let first = block * Self::WIDTH;
            self.act(Some(block));
            self.pass(Some(block), set, 0..sections);
            let count = Self::WIDTH.min(self.tangent_count - first);
            self.store(count, |d| 2 * n + inputs + first + d, out);
        }
    }
}

impl<const N: usize, T: Real> Differentiator for Lifted<N, T> {
    fn run(&mut self, at: Point<'_>, qdd: &mut [f64], out: &mut [f64]) {
        self.plain.run(at, qdd);
        T::enter(Derivatives { lifted: self, at, qdd, out });
    }
}

/// [`Lifted::derivatives`] as a kernel.
struct Derivatives<'a, const N: usize, T> {
    lifted: &'a mut Lifted<N, T>,
    at: Point<'a>,
    qdd: &'a [f64],
    out: &'a mut [f64],
}

impl<const N: usize, T: Real> Kernel for Derivatives<'_, N, T> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.lifted.derivatives(self.at, self.qdd, self.out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::testing::{arms, states};
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
                other.body.sections[0].mass = m;
                other
            };
            let mass = arm.body.sections[0].mass;
            let (a, b) = (heavier(2.0 * mass), heavier(mass));
            let tangents = vec![crate::arm::structure::tangent(&[&a, &b], &[1.0 / mass, -1.0 / mass]).unwrap()];
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
                differentiator(&arm, &tangents, InstructionSet::best()).run(Point { q: &q, qd: &qd, p: &p, f_ext: None }, &mut qdd, &mut out);
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
