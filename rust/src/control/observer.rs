//! Rates of the lengths from length sensors, since real arms measure lengths and pressures only.
//!
//! `kalman`: prediction by the full model under the measured pressures, correction by a steady-state gain from the
//! linearization at a working point (exact derivatives, [`super::linearization`]; Riccati equation, [`super::riccati`]),
//! renewed at the present estimate every so many periods if wanted. The prediction takes steps short against the model's
//! fastest motion (one a period for the nominal arm at 1 kHz; one evaluation each, at the lengths half a step ahead). Where
//! that would be more than some tens, since the arm's damping outweighs its masses, it takes the period in one step of the
//! exponential Rosenbrock-Euler method (Hochbruck & Ostermann, Acta Numerica 19 (2010) 209, sec. 2.4), exact for a linear
//! arm, of second order and stable for any: x + h phi_1(h J) f(x), J the exact Jacobian at the estimate. Beside lengths and rates it estimates a slowly wandering acceleration that the model does not
//! explain (a random walk), so that a wrong model biases that and not the rates.
//! `difference`: differences of the lengths through a first-order low pass; needs no model.
//! Units: lengths m, rates m/s, unexplained acceleration m/s^2.

use super::linearization::linearize;
use super::modes::fastest;
use super::riccati::filter_gain;
use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::recursion::forward_dynamics_into;
use crate::error::{Error, Result};
use nalgebra::DMatrix;
use serde::Deserialize;
use std::sync::Arc;

/// Which observer, with its numbers.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum ObserverParameters {
    /// Filtered differences.
    Difference {
        /// Corner frequency of the low pass, rad/s.
        cutoff: f64,
    },
    /// Kalman filter on the model.
    Kalman {
        /// Standard deviation of measured lengths, m.
        length_noise: f64,
        /// Standard deviation of measured pressures, Pa.
        pressure_noise: f64,
        /// Standard deviation, period by period, of accelerations that the model lacks, m/s^2.
        acceleration_noise: f64,
        /// Wandering of the unexplained acceleration in one second, m/s^2 (a random walk's standard deviation).
        disturbance_noise: f64,
        /// Periods after which the gain is renewed at the present estimate; 0: never.
        renewal: u32,
    },
}

/// Most evaluations of the model a period: beyond, one exponential step costs less.
const MOST_SUBSTEPS: usize = 50;

/// An observer under way.
#[derive(Clone, Debug)]
pub struct Observer {
    parameters: ObserverParameters,
    period: f64,
    arm: Arc<Arm>,
    ws: Workspace,
    /// Estimated lengths, rates and unexplained accelerations, one after the other.
    estimate: Vec<f64>,
    /// 3m x m, row by row.
    gain: Vec<f64>,
    previous: Vec<f64>,
    pressures: Vec<f64>,
    middle: Vec<f64>,
    acceleration: Vec<f64>,
    started: bool,
    since_renewal: u32,
    /// Evaluations of the model a period; 0: one exponential step.
    substeps: usize,
    time: f64,
}

impl Observer {
    /// For `arm` at a period (s).
    ///
    /// # Errors
    /// [`Error::Input`] for a number out of range.
    pub fn new(arm: Arc<Arm>, period: f64, parameters: ObserverParameters) -> Result<Self> {
        let positive = |name: &str, x: f64| {
            if x.is_finite() && x > 0.0 {
                return Ok(());
            }
            Err(Error::Input(format!("observer: {name} is {x}; a positive number is needed")))
        };
        match parameters {
            ObserverParameters::Difference { cutoff } => positive("cutoff", cutoff)?,
            ObserverParameters::Kalman {
                length_noise, pressure_noise, acceleration_noise, disturbance_noise, ..
            } => {
                positive("length_noise", length_noise)?;
                positive("acceleration_noise", acceleration_noise)?;
                positive("disturbance_noise", disturbance_noise)?;
                if !(pressure_noise.is_finite() && pressure_noise >= 0.0) {
                    return Err(Error::Input(format!(
                        "observer: pressure_noise is {pressure_noise}; a number not below zero is needed"
                    )));
                }
            }
        }
        let m = arm.coordinates();
        Ok(Self {
            parameters,
            period,
            ws: Workspace::new(&arm),
            estimate: vec![0.0; 3 * m],
            gain: vec![0.0; 3 * m * m],
            previous: vec![0.0; m],
            pressures: vec![0.0; arm.body.inputs],
            middle: vec![0.0; m],
            acceleration: vec![0.0; m],
            started: false,
            since_renewal: 0,
            substeps: 1,
            time: 0.0,
            arm,
        })
    }

    /// Forgets everything but the gain.
    pub fn reset(&mut self) {
        self.ws = Workspace::new(&self.arm);
        self.time = 0.0;
        self.started = false;
    }

    /// Estimated lengths, m.
    pub fn lengths(&self) -> &[f64] {
        &self.estimate[..self.previous.len()]
    }

    /// Estimated rates, m/s.
    pub fn rates(&self) -> &[f64] {
        &self.estimate[self.previous.len()..2 * self.previous.len()]
    }

    /// Estimated lengths, then rates.
    pub fn state(&self) -> &[f64] {
        &self.estimate[..2 * self.previous.len()]
    }

    /// Estimated acceleration that the model does not explain, m/s^2; zero without a model.
    pub fn disturbance(&self) -> &[f64] {
        &self.estimate[2 * self.previous.len()..]
    }

    /// The Kalman filter's gain, 3m x m row by row: corrections of lengths, rates and unexplained accelerations by the
    /// lengths' innovations; zero before the first measurement and without a model.
    pub fn gain(&self) -> &[f64] {
        &self.gain
    }

    /// Evaluations of the model a period with which the Kalman filter predicts; 0 where it takes one exponential step.
    pub fn substeps(&self) -> usize {
        self.substeps
    }

    /// Takes the measurement of a period: lengths (m) and pressures (Pa absolute).
    ///
    /// # Errors
    /// [`Error::Convergence`] if there is no gain at the working point, or where the estimate is no longer finite.
    pub fn update(&mut self, lengths: &[f64], pressures: &[f64]) -> Result<()> {
        self.take(lengths, pressures)?;
        if self.estimate.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        let (time, period) = (self.time, self.period);
        Err(Error::Convergence(match self.parameters {
            ObserverParameters::Kalman { .. } => format!(
                "at t = {time} s the observer's estimate is no longer finite: the Kalman filter's model has left what it is \
                 good for, at a period of {period} s; a shorter period, gains that lead the arm more calmly, or \
                 FilteredDifference as observer"
            ),
            ObserverParameters::Difference { .. } => {
                format!("at t = {time} s the observer's estimate is no longer finite: the measured lengths are not")
            }
        }))
    }

    fn take(&mut self, lengths: &[f64], pressures: &[f64]) -> Result<()> {
        let m = lengths.len();
        if !self.started {
            self.started = true;
            self.estimate.fill(0.0);
            self.estimate[..m].copy_from_slice(lengths);
            self.previous.copy_from_slice(lengths);
            self.pressures.copy_from_slice(pressures);
            self.since_renewal = 0;
            return self.renew();
        }
        match self.parameters {
            ObserverParameters::Difference { cutoff } => {
                // The low pass of the difference quotient, exactly discretized for a held input.
                let keep = (-cutoff * self.period).exp();
                for k in 0..m {
                    let quotient = (lengths[k] - self.previous[k]) / self.period;
                    self.estimate[m + k] = keep * self.estimate[m + k] + (1.0 - keep) * quotient;
                }
                self.estimate[..m].copy_from_slice(lengths);
                self.previous.copy_from_slice(lengths);
            }
            ObserverParameters::Kalman { renewal, .. } => {
                self.predict(pressures);
                for k in 0..m {
                    self.middle[k] = lengths[k] - self.estimate[k];
                }
                for (x, row) in self.estimate.iter_mut().zip(self.gain.chunks_exact(m)) {
                    *x += row.iter().zip(&self.middle).map(|(l, e)| l * e).sum::<f64>();
                }
                self.since_renewal += 1;
                if renewal > 0 && self.since_renewal >= renewal {
                    self.since_renewal = 0;
                    self.renew()?;
                }
            }
        }
        Ok(())
    }

    /// The estimate one period on, under the pressures of that period.
    fn predict(&mut self, pressures: &[f64]) {
        let (m, h) = (self.previous.len(), self.period);
        self.ws.effects.begin_step(&self.arm.body, self.time, &self.estimate[..2 * m]);
        // An ideal pressure stood at its present value all the period; a real one moved there from the last.
        let ideal = self.arm.pneumatics.is_none();
        for (mean, p) in self.pressures.iter_mut().zip(pressures) {
            *mean = if ideal { *p } else { 0.5 * (*mean + p) };
        }
        if self.substeps == 0 {
            self.leap();
        }
        let (q, rest) = self.estimate.split_at_mut(m);
        let (qd, disturbance) = rest.split_at_mut(m);
        let h = h / self.substeps.max(1) as f64;
        for step in 0..self.substeps {
            for k in 0..m {
                self.middle[k] = q[k] + 0.5 * h * qd[k];
            }
            self.ws.effects.time = self.time + (step as f64 + 0.5) * h;
            let (arm, p, ws) = (&self.arm, &self.pressures, &mut self.ws);
            forward_dynamics_into(arm, &self.middle, qd, p, None, ws, &mut self.acceleration);
            for k in 0..m {
                let before = qd[k];
                qd[k] += h * (self.acceleration[k] + disturbance[k]);
                q[k] += 0.5 * h * (before + qd[k]);
            }
        }
        self.time += self.period;
        self.ws.effects.end_step(&self.arm.body, &self.arm.effects, self.time, &self.estimate[..2 * m]);
        self.pressures.copy_from_slice(pressures);
    }

    /// One exponential step over the period.
    fn leap(&mut self) {
        let (m, h) = (self.previous.len(), self.period);
        // Beyond what the model allows the Jacobian means nothing, and its exponential might not end.
        if !self.estimate.iter().all(|x| x.is_finite()) {
            return;
        }
        let (q, rest) = self.estimate.split_at_mut(m);
        let (qd, disturbance) = rest.split_at_mut(m);
        self.ws.effects.time = self.time;
        forward_dynamics_into(&self.arm, q, qd, &self.pressures, None, &mut self.ws, &mut self.acceleration);
        let linear = linearize(&self.arm, q, qd, &self.pressures);
        let mut block = DMatrix::zeros(2 * m + 1, 2 * m + 1);
        block.view_mut((0, 0), (2 * m, 2 * m)).copy_from(&(linear.state * h));
        for k in 0..m {
            block[(k, 2 * m)] = h * qd[k];
            block[(m + k, 2 * m)] = h * (self.acceleration[k] + disturbance[k]);
        }
        if !block.iter().all(|x| x.is_finite()) {
            self.estimate.fill(f64::NAN);
            return;
        }
        let moved = block.exp();
        for k in 0..m {
            q[k] += moved[(k, 2 * m)];
            qd[k] += moved[(m + k, 2 * m)];
        }
    }

    /// The gain at the present estimate.
    fn renew(&mut self) -> Result<()> {
        let ObserverParameters::Kalman { length_noise, pressure_noise, acceleration_noise, disturbance_noise, .. } =
            self.parameters
        else {
            return Ok(());
        };
        let (m, h) = (self.previous.len(), self.period);
        let linear = linearize(&self.arm, self.lengths(), self.rates(), &self.pressures);
        let fastest = fastest(&linear.state);
        if !fastest.is_finite() {
            return Err(Error::Convergence(format!(
                "at t = {} s the observer's model has no finite derivatives at the measured lengths; check that they are \
                 within the arm's length_range",
                self.time
            )));
        }
        // Explicit steps must be short against the arm's fastest motion, damping included.
        let needed = (h * fastest).ceil().max(1.0);
        self.substeps = if needed > MOST_SUBSTEPS as f64 { 0 } else { needed as usize };
        let (a_d, b_d) = linear.discretized(h);
        let mut a = DMatrix::identity(3 * m, 3 * m);
        a.view_mut((0, 0), (2 * m, 2 * m)).copy_from(&a_d);
        let mut c = DMatrix::zeros(m, 3 * m);
        let mut q = DMatrix::zeros(3 * m, 3 * m);
        q.view_mut((0, 0), (2 * m, 2 * m)).copy_from(&(&b_d * b_d.transpose() * pressure_noise.powi(2)));
        for k in 0..m {
            a[(k, 2 * m + k)] = 0.5 * h * h;
            a[(m + k, 2 * m + k)] = h;
            c[(k, k)] = 1.0;
            q[(m + k, m + k)] += (h * acceleration_noise).powi(2);
            q[(2 * m + k, 2 * m + k)] = disturbance_noise.powi(2) * h;
        }
        let scale: Vec<f64> = (0..3 * m).map(|k| [1.0, h, h * h][k / m]).collect();
        // z = S x with S = diag(1, h, h^2) is in metres: A -> S A S^-1, Q -> S Q S, both over the sensors' variance.
        for i in 0..3 * m {
            for j in 0..3 * m {
                a[(i, j)] *= scale[i] / scale[j];
                q[(i, j)] *= scale[i] * scale[j] / length_noise.powi(2);
            }
        }
        let r = DMatrix::identity(m, m);
        let gain = filter_gain(&a, &c, &q, &r)?;
        for i in 0..3 * m {
            for j in 0..m {
                self.gain[i * m + j] = gain[(i, j)] / scale[i];
            }
        }
        Ok(())
    }
}
