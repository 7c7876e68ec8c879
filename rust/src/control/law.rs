//! Control laws: from lengths, rates and a target to a wanted actuation force tau, or straight to pressures.
//!
//! With e = q_ref - q, lengths q, and the model's M q'' + C q' + N = tau (paper (48)):
//!
//! `pid`: each input by itself, on the mean length b of the bellows it feeds, p = p_0 + k_p e_b + k_i int e_b + k_d e_b'.
//! What a user has without a model.
//!
//! `gravity_pd`: tau = N(q_ref, 0) + K_p e + K_d e' + K_i int e: weight, springs and bending of the target pose fed forward.
//!
//! `static_model`: tau = N(q_c, 0) with q_c = q_ref + k_p e + k_i int e: the static coupled model (62), turned round at a
//! corrected pose. It knows no inertia and no damping.
//!
//! `feedback_linearization`: tau = M a + C q' + N with a = q_ref'' + k_d e' + k_p e - a_d, the model in full or reduced as
//! the arm given says, a_d the observer's unexplained acceleration where wanted. The model is taken at the measured state:
//! the error then has no dynamics but a's, and the arm's own stiffness is cancelled with the model's; or at the corrected
//! reference (q_c, q_ref'), q_c = q_ref + r int e: the same along the reference, but the arm keeps its own stiffness and
//! damping against errors (feedforward linearization, Hagenmeyer & Delaleau, Int. J. Control 76 (2003) 537). An arm whose
//! bellows are stiff and whose stiffness is known to 10 % needs the latter: with k / m = (150 rad/s)^2 cancelled and
//! k_p = (14 rad/s)^2 in its place, a force error of 1 % of the springs' is a large error in length.
//!
//! `state_feedback`: p = p_0(q_ref) + K (x_ref - x), K from the linearization, p_0 by the static model.
//!
//! A force becomes pressures, tau = A(q) (p - p_amb), at the pose that the model is taken at. Taken at the measured lengths
//! instead, A(q) feeds the arm's swing back through the pressures, and behind a lag of some 10 ms that drives it.
//!
//! Anti-windup: while an input is at a limit, an integral only moves towards zero. (`pid`: input by input.)
//! Units: tau N; gains as their names say below.

use super::Target;
use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::inverse_dynamics_into;
use crate::dynamics::terms::generalized_force_into;
use crate::error::{Error, Result};
use crate::forces::{ForceSet, length};
use crate::kinematics::coordinates::arc_from_lengths;
use crate::real::linear::Vec3;
use serde::Deserialize;

/// Which law, with its gains.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum LawParameters {
    /// PID on lengths.
    Pid {
        /// One an input, Pa/m.
        proportional: Vec<f64>,
        /// One an input, Pa/(m s).
        integral: Vec<f64>,
        /// One an input, Pa s/m.
        derivative: Vec<f64>,
    },
    /// PD with gravity and stiffness compensation.
    GravityPd {
        /// One a length, N/m.
        proportional: Vec<f64>,
        /// One a length, N/(m s).
        integral: Vec<f64>,
        /// One a length, N s/m.
        derivative: Vec<f64>,
    },
    /// The static model turned round.
    StaticModel {
        /// Plain number.
        proportional: f64,
        /// 1/s.
        integral: f64,
    },
    /// Feedback linearization.
    FeedbackLinearization {
        /// 1/s^2.
        proportional: f64,
        /// Rate at which the reference's pose is corrected, 1/s, or for the model at the measured state 1/s^3.
        integral: f64,
        /// 1/s.
        derivative: f64,
        /// Whether the model is taken at the measured state.
        at_measured: bool,
        /// Whether the observer's unexplained acceleration is taken off.
        compensate_disturbance: bool,
    },
    /// Constant gain on lengths and rates.
    StateFeedback {
        /// inputs x 2m, row by row, Pa/m and Pa s/m.
        gain: Vec<f64>,
    },
}

/// What a law wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// An actuation force at the measured lengths, in [`Law::tau`].
    Force,
    /// The same, at the lengths in [`Law::pose`].
    ForceAtPose,
    /// Pressures in [`Law::pressures`]; for `state_feedback` these are added to those of the force at [`Law::pose`].
    Pressures,
}

/// A law under way.
#[derive(Clone, Debug)]
pub struct Law {
    parameters: LawParameters,
    period: f64,
    /// Mean bellows length of each input from the lengths, inputs x m (`pid`).
    mean_length: Vec<f64>,
    integral: Vec<f64>,
    /// Pressures when it began (`pid`).
    bias: Vec<f64>,
    /// Wanted actuation force, N.
    pub tau: Vec<f64>,
    /// Lengths at which it is meant, m.
    pub pose: Vec<f64>,
    /// Wanted pressures (`pid`) or what is added to them (`state_feedback`), Pa.
    pub pressures: Vec<f64>,
    still: Vec<f64>,
    acceleration: Vec<f64>,
}

/// What is known of the arm in a period.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// Lengths, m.
    pub q: &'a [f64],
    /// Rates, m/s.
    pub qd: &'a [f64],
    /// Acceleration the model does not explain, m/s^2.
    pub disturbance: &'a [f64],
}

impl Law {
    /// For `arm` at a period (s).
    ///
    /// # Errors
    /// [`Error::Input`] for a gain that is not finite or a wrong number of gains.
    pub fn new(arm: &Arm, period: f64, parameters: LawParameters) -> Result<Self> {
        let (m, inputs) = (arm.coordinates(), arm.body.inputs);
        let check = |name: &str, gains: &[f64], count: usize| {
            if gains.len() == count && gains.iter().all(|g| g.is_finite()) {
                return Ok(());
            }
            Err(Error::Input(format!("controller: {name}: {count} finite numbers are needed, found {gains:?}")))
        };
        let integrals = match &parameters {
            LawParameters::Pid { proportional, integral, derivative } => {
                check("proportional", proportional, inputs)?;
                check("integral", integral, inputs)?;
                check("derivative", derivative, inputs)?;
                inputs
            }
            LawParameters::GravityPd { proportional, integral, derivative } => {
                check("proportional", proportional, m)?;
                check("integral", integral, m)?;
                check("derivative", derivative, m)?;
                m
            }
            LawParameters::StaticModel { proportional, integral } => {
                check("proportional", &[*proportional], 1)?;
                check("integral", &[*integral], 1)?;
                m
            }
            LawParameters::FeedbackLinearization { proportional, integral, derivative, .. } => {
                check("gains", &[*proportional, *integral, *derivative], 3)?;
                m
            }
            LawParameters::StateFeedback { gain } => {
                check("gain", gain, 2 * m * inputs)?;
                0
            }
        };
        Ok(Self {
            parameters,
            period,
            mean_length: mean_lengths(arm),
            integral: vec![0.0; integrals],
            bias: vec![0.0; inputs],
            tau: vec![0.0; m],
            pose: vec![0.0; m],
            pressures: vec![0.0; inputs],
            still: vec![0.0; m],
            acceleration: vec![0.0; m],
        })
    }

    /// Begins anew under pressures `p` (Pa absolute).
    pub fn reset(&mut self, p: &[f64]) {
        self.integral.fill(0.0);
        self.bias.copy_from_slice(p);
    }

    /// Evaluates the law; `at_limit` says which inputs are at a limit now (-1, 0, 1).
    pub fn evaluate(
        &mut self,
        arm: &Arm,
        state: State<'_>,
        target: Target<'_>,
        at_limit: &[i8],
        ws: &mut Workspace,
    ) -> Output {
        let m = state.q.len();
        let limited = at_limit.iter().any(|b| *b != 0);
        let h = self.period;
        // Integrals run over the error before this period's, so that the law is explicit; at a limit only back to zero.
        let advance = |integral: &mut f64, gain: f64, error: f64, limited: bool| {
            let change = h * gain * error;
            if !limited || change * *integral < 0.0 {
                *integral += change;
            }
        };
        match &self.parameters {
            LawParameters::Pid { proportional, integral, derivative } => {
                for j in 0..self.pressures.len() {
                    let row = &self.mean_length[j * m..(j + 1) * m];
                    let (mut error, mut rate) = (0.0, 0.0);
                    for k in 0..m {
                        error += row[k] * (target.q[k] - state.q[k]);
                        rate += row[k] * (target.qd[k] - state.qd[k]);
                    }
                    let outward = f64::from(at_limit[j]) * error > 0.0;
                    advance(&mut self.integral[j], integral[j], error, outward);
                    self.pressures[j] =
                        self.bias[j] + proportional[j] * error + self.integral[j] + derivative[j] * rate;
                }
                Output::Pressures
            }
            LawParameters::GravityPd { proportional, integral, derivative } => {
                static_force(arm, target.q, &self.still, ws, &mut self.tau);
                self.pose.copy_from_slice(target.q);
                for k in 0..m {
                    let (error, rate) = (target.q[k] - state.q[k], target.qd[k] - state.qd[k]);
                    advance(&mut self.integral[k], integral[k], error, limited);
                    self.tau[k] += proportional[k] * error + self.integral[k] + derivative[k] * rate;
                }
                Output::ForceAtPose
            }
            LawParameters::StaticModel { proportional, integral } => {
                for k in 0..m {
                    let error = target.q[k] - state.q[k];
                    advance(&mut self.integral[k], *integral, error, limited);
                    self.pose[k] = target.q[k] + proportional * error + self.integral[k];
                }
                static_force(arm, &self.pose, &self.still, ws, &mut self.tau);
                Output::ForceAtPose
            }
            LawParameters::FeedbackLinearization {
                proportional,
                integral,
                derivative,
                at_measured,
                compensate_disturbance,
            } => {
                let unexplained = if *compensate_disturbance { 1.0 } else { 0.0 };
                for k in 0..m {
                    let (error, rate) = (target.q[k] - state.q[k], target.qd[k] - state.qd[k]);
                    advance(&mut self.integral[k], *integral, error, limited);
                    self.acceleration[k] =
                        target.qdd[k] + derivative * rate + proportional * error - unexplained * state.disturbance[k];
                    self.pose[k] = target.q[k] + self.integral[k];
                }
                if *at_measured {
                    for (a, integral) in self.acceleration.iter_mut().zip(&self.integral) {
                        *a += integral;
                    }
                    inverse_dynamics_into(arm, state.q, state.qd, &self.acceleration, None, ws, &mut self.tau);
                } else {
                    inverse_dynamics_into(arm, &self.pose, target.qd, &self.acceleration, None, ws, &mut self.tau);
                    return Output::ForceAtPose;
                }
                Output::Force
            }
            LawParameters::StateFeedback { gain } => {
                self.pose.copy_from_slice(target.q);
                static_force(arm, target.q, &self.still, ws, &mut self.tau);
                for (p, row) in self.pressures.iter_mut().zip(gain.chunks_exact(2 * m)) {
                    *p = 0.0;
                    for k in 0..m {
                        *p += row[k] * (target.q[k] - state.q[k]) + row[m + k] * (target.qd[k] - state.qd[k]);
                    }
                }
                Output::Pressures
            }
        }
    }

    /// The force that the target alone asks for, by the law's model, into [`Law::tau`]; false for laws without one.
    pub fn feed_forward(&mut self, arm: &Arm, target: Target<'_>, ws: &mut Workspace) -> bool {
        match self.parameters {
            LawParameters::Pid { .. } => return false,
            LawParameters::FeedbackLinearization { .. } => {
                inverse_dynamics_into(arm, target.q, target.qd, target.qdd, None, ws, &mut self.tau);
            }
            _ => static_force(arm, target.q, &self.still, ws, &mut self.tau),
        }
        true
    }

    /// Whether [`Law::pressures`] are to be added to those of the force at [`Law::pose`].
    pub fn adds_to_force(&self) -> bool {
        matches!(self.parameters, LawParameters::StateFeedback { .. })
    }
}

/// N(q, 0): what the pressures must hold at rest, N.
pub fn static_force(arm: &Arm, q: &[f64], still: &[f64], ws: &mut Workspace, out: &mut [f64]) {
    generalized_force_into(arm, ForceSet::PASSIVE, (q, still), &[], None, ws, out);
    for f in out {
        *f = -*f;
    }
}

/// Mean length of the bellows of each input as a linear map of the lengths, inputs x m, row by row.
fn mean_lengths(arm: &Arm) -> Vec<f64> {
    let m = arm.coordinates();
    let mut out = vec![0.0; arm.body.inputs * m];
    let mut counts = vec![0.0_f64; arm.body.inputs];
    for (i, section) in arm.body.sections.iter().enumerate() {
        for b in &section.bellows {
            counts[b.input] += 1.0;
            for k in 0..3 {
                let unit = Vec3([0, 1, 2].map(|j| f64::from(j == k)));
                out[b.input * m + 3 * i + k] += length(b, arc_from_lengths(unit, section.inverse_radius));
            }
        }
    }
    for (row, count) in out.chunks_exact_mut(m).zip(&counts) {
        row.iter_mut().for_each(|x| *x /= count.max(1.0));
    }
    out
}
