//! Which steps an arm can be taken in: the one place that steppers, environments, observers and loops ask.
//!
//! Around rest an arm is x' = A x (exact derivatives, [`crate::control::linearization`]; behind `full` pneumatics with the
//! trapped air as a spring). An explicit method is stable while its own linear map of a step has no eigenvalue outside the
//! unit circle: R(h lambda) for the Runge-Kutta method (Hairer & Wanner, *Solving Ordinary Differential Equations II*,
//! sec. IV.2), the map of rates, then lengths for the symplectic Euler method. Arms whose damping outweighs their masses
//! need steps of microseconds there; the linearly implicit method is stable with any step.
//! Limits: rests under given pressures, linear. A reserve covers what lies between them and beyond.

use crate::arm::Arm;
use crate::body::parameters::PneumaticsLevel;
use crate::control::linearization::{Linearization, linearize};
use crate::control::modes::{MANY_STATES, eigenvalues, fastest};
use crate::dynamics::statics::rest;
use crate::error::{Error, Result};
use crate::integrate::Method;
use crate::pneumatics::{LONGEST_STEP, chamber};
use nalgebra::{Complex, DMatrix};

/// Part of the longest stable step that is taken where the step is chosen here.
const RESERVE: f64 = 0.7;
/// Steps that are this much shorter than stable ones at the rests looked at first need no further look.
const AMPLE: f64 = 3.0;
/// How many rests are looked at in any case.
const FIRST: usize = 3;
/// Growth over a step that counts as none.
const ROUNDING: f64 = 1e-6;
/// With h lambda of this modulus in the left half plane each explicit method is stable: Runge-Kutta, symplectic Euler.
const SAFE: (f64, f64) = (2.0, 0.8);

/// How an arm is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stepping {
    /// The classical Runge-Kutta method of fourth order.
    RungeKutta,
    /// The symplectic Euler method.
    SymplecticEuler,
    /// The linearly implicit method of second order.
    LinearlyImplicit,
}

impl Stepping {
    /// By the user's name.
    pub fn by_name(name: &str) -> Option<Self> {
        [Self::RungeKutta, Self::SymplecticEuler, Self::LinearlyImplicit].into_iter().find(|s| s.name() == name)
    }

    /// The user's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::RungeKutta => "rk4",
            Self::SymplecticEuler => "symplectic_euler",
            Self::LinearlyImplicit => "ros2",
        }
    }

    /// The method of the integrator; the symplectic Euler method is none of its.
    pub fn method(self) -> Method {
        match self {
            Self::LinearlyImplicit => Method::Ros2,
            _ => Method::Rk4,
        }
    }
}

/// A method with its longest step, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// The method.
    pub stepping: Stepping,
    /// Its longest step, s.
    pub step: f64,
}

/// What somebody wants of a [`Plan`].
#[derive(Clone, Copy, Debug)]
pub struct Wish {
    /// The method; the cheapest stable one if none.
    pub stepping: Option<Stepping>,
    /// The longest step, s; what is stable, and not more than `usual`, if none.
    pub step: Option<f64>,
    /// The longest step where none is wanted, s.
    pub usual: f64,
}

/// The method and step for `arm` at rest under each row of `pressures` (one an input, Pa absolute).
///
/// # Errors
/// [`Error::Input`] for a step that is not positive, or that the method asked for is not stable with;
/// [`Error::Convergence`] if the arm rests under none of the pressures; [`Error::Interrupted`] if `stop` said so.
pub fn plan(arm: &Arm, pressures: &[f64], wish: Wish, stop: &mut impl FnMut() -> bool) -> Result<Plan> {
    if let Some(step) = wish.step
        && !(step.is_finite() && step > 0.0)
    {
        return Err(Error::Input(format!("step: {step}; a positive number of seconds is needed")));
    }
    let wanted = wish.step.unwrap_or(wish.usual);
    let wanted = if arm.pneumatics.is_some() { wanted.min(LONGEST_STEP) } else { wanted };
    if wish.stepping == Some(Stepping::LinearlyImplicit) {
        return Ok(Plan { stepping: Stepping::LinearlyImplicit, step: wanted });
    }
    let explicit = wish.stepping.unwrap_or(Stepping::RungeKutta);
    let longest = longest_step(arm, pressures, (explicit, AMPLE * wanted), stop)?;
    let step = wanted.min(RESERVE * longest);
    if wish.stepping.is_some() {
        return match wish.step {
            Some(given) if wanted > longest => Err(Error::Input(format!(
                "step: {given:e} s; {} is stable with this arm for steps up to {longest:.1e} s: give a shorter one, leave it \
                 out, or choose the method \"ros2\", which is stable with any",
                explicit.name()
            ))),
            Some(_) => Ok(Plan { stepping: explicit, step: wanted }),
            None => Ok(Plan { stepping: explicit, step }),
        };
    }
    // Of second order only, it takes half the usual step where the choice is left.
    let implicit = if wish.step.is_none() { 0.5 * wanted } else { wanted };
    // Evaluations of the equations of motion a second; a factorization of the Jacobian costs about two.
    let (cheap, stiff) = (4.0 / step, (2.0 * arm.coordinates() as f64 + 5.0) / implicit);
    if cheap <= stiff {
        return Ok(Plan { stepping: explicit, step });
    }
    Ok(Plan { stepping: Stepping::LinearlyImplicit, step: implicit })
}

/// The longest step with which an explicit method is stable at rest under each row of `pressures`, s.
///
/// Once the first few rests have shown that it is longer than `enough`, the others are not looked at.
///
/// # Errors
/// [`Error::Convergence`] if the arm rests under none of them; [`Error::Interrupted`] if `stop` said so.
pub fn longest_step(
    arm: &Arm,
    pressures: &[f64],
    (stepping, enough): (Stepping, f64),
    stop: &mut impl FnMut() -> bool,
) -> Result<f64> {
    let (mut longest, mut seen, mut failure) = (f64::INFINITY, 0, None);
    for p in pressures.chunks_exact(arm.body.inputs) {
        if seen >= FIRST && longest > enough {
            break;
        }
        match rest(arm, p, None, stop) {
            Ok(q) => {
                seen += 1;
                longest = stable_step(&around_rest(arm, &q, p), stepping, longest);
            }
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error) => failure = Some(error),
        }
    }
    match failure {
        Some(error) if seen == 0 => Err(error),
        _ => Ok(longest),
    }
}

/// A of x' = A x at rest at lengths `q` under pressures `p`; chambers that are closed are springs.
fn around_rest(arm: &Arm, q: &[f64], p: &[f64]) -> DMatrix<f64> {
    let m = q.len();
    let Linearization { mut state, input } = linearize(arm, q, &vec![0.0; m], p);
    if let Some(pneumatics) = &arm.pneumatics
        && pneumatics.level == PneumaticsLevel::Full
    {
        let none = vec![chamber::Volume::rigid(0.0); arm.body.inputs];
        let (mut volumes, mut areas) = (none.clone(), none);
        chamber::volumes(&arm.body, pneumatics.dead_volume, q, &mut volumes);
        for k in 0..m {
            let unit: Vec<f64> = (0..m).map(|j| f64::from(j == k)).collect();
            chamber::volume_rates(&arm.body, (q, &unit), &mut areas);
            for j in 0..arm.body.inputs {
                // p V^n stays.
                let (gauge, stiffness) = (p[j] - arm.body.ambient_pressure, pneumatics.exponent * p[j]);
                let slope =
                    -stiffness * areas[j].at(gauge) / (volumes[j].at(gauge) + stiffness * volumes[j].by_pressure);
                for r in 0..m {
                    state[(m + r, k)] += input[(m + r, j)] * slope;
                }
            }
        }
    }
    state
}

/// The longest step up to `most` with which `stepping` is stable on x' = `state` x.
fn stable_step(state: &DMatrix<f64>, stepping: Stepping, most: f64) -> f64 {
    if state.nrows() > MANY_STATES {
        let safe = if stepping == Stepping::SymplecticEuler { SAFE.1 } else { SAFE.0 };
        return most.min(safe / fastest(state));
    }
    let found = eigenvalues(state);
    let fastest = found.iter().fold(0.0_f64, |m, z| m.max(z.norm()));
    let growth = found.iter().fold(0.0_f64, |m, z| m.max(z.re));
    // No explicit method of these reaches beyond; short steps of this row of numbers are stable for both.
    let mut h = most.min(3.0 / fastest);
    while h * fastest > 1e-3 {
        // An arm that falls away from its rest by itself may, also a little faster than it does.
        let allowed = (2.0 * growth.max(0.0) * h).exp() * (1.0 + ROUNDING);
        let stable = match stepping {
            Stepping::LinearlyImplicit => true,
            Stepping::RungeKutta => found.iter().all(|z| runge_kutta(*z * h).norm() <= allowed),
            Stepping::SymplecticEuler => eigenvalues(&symplectic_euler(state, h)).iter().all(|z| z.norm() <= allowed),
        };
        if stable {
            return h;
        }
        h *= 0.97;
    }
    h
}

/// R(z) of the classical Runge-Kutta method.
fn runge_kutta(z: Complex<f64>) -> Complex<f64> {
    let one = Complex::new(1.0, 0.0);
    one + z * (one + z / 2.0 * (one + z / 3.0 * (one + z / 4.0)))
}

/// A step of the symplectic Euler method: q'+ = q' + h (A q + D q'), q+ = q + h q'+.
fn symplectic_euler(state: &DMatrix<f64>, h: f64) -> DMatrix<f64> {
    let (n, m) = (state.nrows(), state.nrows() / 2);
    let mut map = DMatrix::identity(n, n);
    for r in 0..m {
        for c in 0..n {
            map[(m + r, c)] += h * state[(m + r, c)];
        }
        for c in 0..n {
            let rate = map[(m + r, c)];
            map[(r, c)] += h * rate;
        }
    }
    map
}

#[cfg(test)]
mod tests {
    use super::*;

    /// q'' = -w^2 q - 2 d w q'.
    fn oscillator(w: f64, d: f64) -> DMatrix<f64> {
        DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -w * w, -2.0 * d * w])
    }

    /// Limits that are known in closed form: 2.828 on the imaginary axis and 2.785 on the real one for the Runge-Kutta
    /// method; 2 for a free oscillation, and -2 d + 2 sqrt(d^2 + 1) where it is damped, for the symplectic Euler method.
    #[test]
    fn limits_of_an_oscillator() {
        let limit = |w, d, stepping| w * stable_step(&oscillator(w, d), stepping, f64::INFINITY);
        let near = |found: f64, expected: f64| found <= 1.001 * expected && found > 0.96 * expected;
        assert!(near(limit(50.0, 0.0, Stepping::RungeKutta), 8.0_f64.sqrt()));
        assert!(near(limit(50.0, 1e6, Stepping::RungeKutta) * 2e6, 2.785));
        assert!(near(limit(50.0, 0.0, Stepping::SymplecticEuler), 2.0));
        for d in [0.3_f64, 1.0, 40.0] {
            let expected = 2.0 * ((d * d + 1.0).sqrt() - d);
            assert!(near(limit(50.0, d, Stepping::SymplecticEuler), expected), "{d}");
        }
    }

    /// Where there are too many states for eigenvalues: a chain of oscillators, slow ones and one that is fast and damped.
    #[test]
    fn the_fastest_of_many() {
        let state = crate::control::modes::testing::chain_of_oscillators();
        let step = stable_step(&state, Stepping::RungeKutta, f64::INFINITY);
        assert!((0.9..1.1).contains(&(90.0 * step / SAFE.0)));
    }

    /// What falls away from its rest has no stable step in the strict sense; it is followed all the same.
    #[test]
    fn a_pole_to_the_right_is_allowed() {
        let falling = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 9.0, -1.0]);
        for stepping in [Stepping::RungeKutta, Stepping::SymplecticEuler] {
            assert!(stable_step(&falling, stepping, f64::INFINITY) > 0.3);
        }
    }
}
