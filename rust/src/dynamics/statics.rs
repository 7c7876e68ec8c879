//! Lengths at rest for constant pressures.
//!
//! Source: static coupled, paper (62): N(q, 0) = tau(q, p), implicit in q; static decoupled: spring force against static
//! pressure only, without gravity and bending (the paper's last row of Table III).
//! Solved by Newton's method with exact derivatives (dual numbers) and a step limit; where Newton stalls, the arm is let
//! sink along an overdamped flow (implicit Euler pseudo-time steps, which are Newton steps with a diagonal added).

use super::Workspace;
use super::terms::generalized_force_into;
use crate::arm::Arm;
use crate::effects;
use crate::error::{Error, Result};
use crate::forces::{External, ForceSet, PointWrench, length, spring};
use crate::kinematics::coordinates::{arc_from_lengths, lengths_from_arc};
use crate::real::linear::{Sym3, Vec3};
use crate::real::{Dual, Real};
use nalgebra::{DMatrix, DVector};

/// Newton steps before giving up.
const MAX_ITERATIONS: usize = 400;
/// Largest change of a length in one step, m.
const MAX_STEP: f64 = 0.05;

const STATIC: ForceSet = ForceSet { damping: false, ..ForceSet::ALL };

/// Derivatives taken at once: the Jacobian's columns in blocks of this many.
const BLOCK: usize = 4;

/// The equations' residual (generalized force, N) and its Jacobian, of one arm under pressures and forces that change.
pub(super) struct Equations<'a> {
    arm: &'a Arm<f64>,
    lifted: Arm<Dual<BLOCK>>,
    p: Vec<f64>,
    p_lifted: Vec<Dual<BLOCK>>,
    f_ext: Option<External<'a, f64>>,
    forces: Vec<Vec3<Dual<BLOCK>>>,
    wrenches: Vec<PointWrench<Dual<BLOCK>>>,
    ws: Workspace<f64>,
    ws_lifted: Workspace<Dual<BLOCK>>,
}

impl<'a> Equations<'a> {
    pub(super) fn new(arm: &'a Arm<f64>) -> Self {
        let lifted = arm.lift::<Dual<BLOCK>>();
        Self {
            arm,
            p: Vec::new(),
            p_lifted: Vec::new(),
            f_ext: None,
            forces: Vec::new(),
            wrenches: Vec::new(),
            ws: Workspace::new(arm),
            ws_lifted: Workspace::new(&lifted),
            lifted,
        }
    }

    /// From here on under pressures `p` (one an input, Pa) and external forces.
    pub(super) fn set(&mut self, p: &[f64], f_ext: Option<External<'a, f64>>) {
        self.p.clear();
        self.p.extend_from_slice(p);
        self.p_lifted.clear();
        self.p_lifted.extend(p.iter().map(|&x| Dual::from_f64(x)));
        self.f_ext = f_ext;
        self.forces.clear();
        self.wrenches.clear();
        if let Some(f) = f_ext {
            self.forces.extend(f.forces.iter().map(|v| Vec3::from_f64(v.0)));
            self.wrenches.extend(f.wrenches.iter().map(PointWrench::lifted));
        }
    }

    /// Generalized force, N, that is not balanced at lengths `q`.
    pub(super) fn residual(&mut self, q: &DVector<f64>) -> DVector<f64> {
        let mut out = DVector::zeros(q.len());
        let state = (q.as_slice(), [].as_slice());
        generalized_force_into(self.arm, STATIC, state, &self.p, self.f_ext, &mut self.ws, out.as_mut_slice());
        out
    }

    /// Its derivative by the lengths; None if `stop` said so.
    pub(super) fn jacobian(&mut self, q: &DVector<f64>, stop: &mut impl FnMut() -> bool) -> Option<DMatrix<f64>> {
        let n = q.len();
        let mut jacobian = DMatrix::zeros(n, n);
        let mut out = vec![Dual::zero(); n];
        for block in (0..n).step_by(BLOCK) {
            if stop() {
                return None;
            }
            let dual: Vec<_> =
                (0..n).map(|k| Dual::variable(q[k], if k < block { BLOCK } else { k - block })).collect();
            let state = (dual.as_slice(), [].as_slice());
            let f = External { forces: &self.forces, wrenches: &self.wrenches };
            generalized_force_into(&self.lifted, STATIC, state, &self.p_lifted, Some(f), &mut self.ws_lifted, &mut out);
            for (row, d) in out.iter().enumerate() {
                for (k, value) in d.derivative.iter().enumerate() {
                    if block + k < n {
                        jacobian[(row, block + k)] = *value;
                    }
                }
            }
        }
        Some(jacobian)
    }

    /// Lengths at rest, from `start` (from the static decoupled lengths if none) on, unless `stop` says so.
    pub(super) fn rest(&mut self, start: Option<&[f64]>, stop: &mut impl FnMut() -> bool) -> Result<Vec<f64>> {
        let first = match start {
            Some(q) => q.to_vec(),
            None => decoupled(self.arm, &self.p)?,
        };
        let mut q = DVector::from_vec(first);
        let mut r = self.residual(&q);
        // Pseudo-time damping, N/m: 0 is plain Newton.
        let mut damping = 0.0;
        let scale = 1.0 + r.amax();
        for _ in 0..MAX_ITERATIONS {
            let jacobian = self.jacobian(&q, stop).ok_or(Error::Interrupted)?;
            let mut matrix = -&jacobian;
            for k in 0..q.len() {
                matrix[(k, k)] += damping;
            }
            let solved = matrix.lu().solve(&r);
            let typical = jacobian.amax();
            let Some(step) = solved.filter(|s| s.iter().all(|x| x.is_finite())) else {
                damping = (10.0 * damping).max(1e-3 * typical);
                continue;
            };
            let largest = step.amax();
            let step = &step * (MAX_STEP / largest.max(MAX_STEP));
            let next = &q + &step;
            let r_next = self.residual(&next);
            let improved = r_next.norm() < r.norm();
            if r_next.iter().all(|x| x.is_finite()) && (improved || damping > 10.0 * typical) {
                (q, r) = (next, r_next);
                damping = if damping < 1e-4 * typical { 0.0 } else { 0.3 * damping };
            } else {
                damping = (5.0 * damping).max(1e-3 * typical);
            }
            if largest < 1e-13 || (r.amax() < 1e-9 * scale && largest < 1e-9) {
                return possible(self.arm, q.as_slice().to_vec());
            }
        }
        Err(Error::Convergence(format!(
            "no rest found after {MAX_ITERATIONS} steps: a force of {:.3e} N is left; check that the pressures lie in the \
             arm's pressure_range, or start nearer to the expected lengths",
            r.amax()
        )))
    }
}

/// Lengths at which the arm rests under pressures `p` (one an input, Pa) and external forces: static coupled (62).
///
/// Starts from `start` (from the static decoupled lengths if none).
///
/// # Errors
/// [`Error::Convergence`] with the residual left, if no rest is found, or if a section's mean length at rest is not positive.
pub fn static_lengths(
    arm: &Arm<f64>,
    p: &[f64],
    f_ext: Option<External<'_, f64>>,
    start: Option<&[f64]>,
) -> Result<Vec<f64>> {
    static_lengths_until(arm, p, f_ext, start, &mut || false)
}

/// As [`static_lengths`], unless `stop`, asked now and then, says so.
///
/// # Errors
/// As [`static_lengths`]; [`Error::Interrupted`] if `stop` said so.
pub fn static_lengths_until(
    arm: &Arm<f64>,
    p: &[f64],
    f_ext: Option<External<'_, f64>>,
    start: Option<&[f64]>,
    stop: &mut impl FnMut() -> bool,
) -> Result<Vec<f64>> {
    let mut equations = Equations::new(arm);
    equations.set(p, f_ext);
    equations.rest(start, stop)
}

/// Lengths at rest, if the mean length of every section is positive, as it must be in a simulation too.
fn possible(arm: &Arm<f64>, q: Vec<f64>) -> Result<Vec<f64>> {
    for (i, lengths) in q.chunks_exact(3).enumerate().take(arm.body.sections.len()) {
        let mean = lengths.iter().sum::<f64>() / 3.0;
        if mean <= 0.0 {
            return Err(Error::Convergence(format!(
                "section {}: its mean length at rest would be {mean:.4} m, which is not positive; check the pressures (is \
                 this gauge pressure? absolute pressures are needed, in the arm's pressure_range), rest_length and stiffness",
                i + 1
            )));
        }
    }
    Ok(q)
}

/// Lengths from spring forces (also those on the mean length) against static pressure only, each section by itself: static
/// decoupled.
///
/// # Errors
/// [`Error::Convergence`] naming the section whose springs cannot hold the pressure, or whose mean length is not positive.
pub fn static_decoupled_lengths(arm: &Arm<f64>, p: &[f64]) -> Result<Vec<f64>> {
    possible(arm, decoupled(arm, p)?)
}

/// The same wherever the lengths are.
fn decoupled(arm: &Arm<f64>, p: &[f64]) -> Result<Vec<f64>> {
    let mut out = Vec::with_capacity(arm.coordinates());
    for (i, section) in arm.body.sections.iter().enumerate() {
        let count = section.bellows.len() as f64;
        let mean_rest = section.bellows.iter().map(|b| b.rest_length).sum::<f64>() / count;
        let mut arc = Vec3([0.0, 0.0, mean_rest]);
        let mut damping = 0.0;
        let mut left = f64::INFINITY;
        for _ in 0..MAX_ITERATIONS {
            // Force on (u r, v r, l) and its (symmetric) stiffness, lengths as unit of all three.
            let r = section.bellows_radius;
            let (mut force, mut stiffness) = (Vec3::zero(), Sym3::zero());
            for b in &section.bellows {
                let e = length(b, arc) - b.rest_length;
                let terms = &b.stiffness[..b.stiffness_terms];
                let f = b.terminal_area * (p[b.input] - arm.body.ambient_pressure) - spring::force(terms, e);
                let k = spring::slope(terms, e);
                let d = Vec3([-b.x / r, -b.y / r, 1.0]);
                force += d * f;
                let [x, y, z] = d.0;
                stiffness = stiffness.add(&Sym3([x * x, x * y, x * z, y * y, y * z, z * z].map(|v| v * k)));
            }
            if let Some(axial) = &section.axial {
                let (e, terms) = (arc.z() - axial.rest_length, &axial.stiffness[..axial.stiffness_terms]);
                force -= Vec3([0.0, 0.0, spring::force(terms, e)]);
                stiffness = stiffness.add(&Sym3([0.0, 0.0, 0.0, 0.0, 0.0, spring::slope(terms, e)]));
            }
            left = Vec3::dot(force, force).sqrt();
            let typical = stiffness.0.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let damped = stiffness.add(&Sym3([damping, 0.0, 0.0, damping, 0.0, damping]));
            let step = damped.inverse().mul_vec(force);
            let downhill = step.dot(force) > 0.0;
            if !step.0.iter().all(|x| x.is_finite()) || !downhill {
                damping = (4.0 * damping).max(0.1 * typical.max(1.0));
                continue;
            }
            let largest = step.0.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            let step = step * (MAX_STEP / largest.max(MAX_STEP));
            arc += Vec3([step.x() / r, step.y() / r, step.z()]);
            damping = if damping < 1e-6 * typical { 0.0 } else { 0.3 * damping };
            if largest < 1e-14 || (largest < 1e-10 && damping == 0.0) {
                left = 0.0;
                break;
            }
        }
        if left != 0.0 {
            return Err(Error::Convergence(format!(
                "section {}: its springs do not balance the pressures ({left:.3e} N left); check stiffness and pressure",
                i + 1
            )));
        }
        let lengths = lengths_from_arc(arc, section.bellows_radius);
        debug_assert!(arc_from_lengths(lengths, section.inverse_radius).z().is_finite());
        out.extend(lengths.0);
    }
    Ok(out)
}
/// Lengths at rest under chamber pressures `p`, of which effects on pressures make the acting ones.
///
/// # Errors
/// As for [`static_lengths_until`].
pub fn rest(arm: &Arm, p: &[f64], start: Option<&[f64]>, stop: &mut impl FnMut() -> bool) -> Result<Vec<f64>> {
    let mut acting = p.to_vec();
    effects::pressures::at_rest(&arm.effects, &mut acting);
    static_lengths_until(arm, &acting, None, start, stop)
}
