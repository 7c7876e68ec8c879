//! A controller: observer, law, allocation and limits as one thing that takes measurements and gives pressures.

use super::allocation::Allocation;
use super::law::{Law, LawParameters, Output, State};
use super::observer::{Observer, ObserverParameters};
use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::error::{Error, Result};
use serde::Deserialize;
use std::sync::Arc;

/// Lowest, highest and preferred pressure of each input, Pa absolute.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Lowest.
    pub low: Vec<f64>,
    /// Highest.
    pub high: Vec<f64>,
    /// What is chosen where the wanted force leaves a choice.
    pub preferred: Vec<f64>,
}

impl Limits {
    /// Checked for an arm.
    ///
    /// # Errors
    /// [`Error::Input`] for wrong sizes or an empty range.
    pub fn check(&self, inputs: usize) -> Result<()> {
        for (name, values) in [("low", &self.low), ("high", &self.high), ("preferred", &self.preferred)] {
            if values.len() != inputs || values.iter().any(|x| !x.is_finite()) {
                return Err(Error::Input(format!(
                    "limits: {name}: {inputs} finite numbers are needed, found {values:?}"
                )));
            }
        }
        match self.low.iter().zip(&self.high).position(|(l, h)| l >= h) {
            Some(j) => Err(Error::Input(format!(
                "limits: input {}: the range is empty, {} is not below {}",
                j + 1,
                self.low[j],
                self.high[j]
            ))),
            None => Ok(()),
        }
    }
}

/// Everything a controller is made from but its arm.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerParameters {
    /// Control period, s.
    pub period: f64,
    /// The law.
    pub law: LawParameters,
    /// The observer.
    pub observer: ObserverParameters,
    /// Limits of the pressures.
    pub limits: Limits,
    /// Time constant T of the pressures that is taken back, s; 0: none. T times the rate of the pressures that the
    /// target alone asks for is added: a lead without the sensors' noise, and outside the feedback, which it cannot
    /// upset.
    pub lead_time: f64,
}

/// Where the arm should be in a period.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Lengths, m.
    pub q: &'a [f64],
    /// Rates, m/s.
    pub qd: &'a [f64],
    /// Accelerations, m/s^2.
    pub qdd: &'a [f64],
}

/// A controller under way. Nothing is allocated between renewals of the observer's gain.
#[derive(Clone, Debug)]
pub struct Controller {
    arm: Arc<Arm>,
    parameters: ControllerParameters,
    law: Law,
    observer: Observer,
    allocation: Allocation,
    ws: Workspace,
    at_limit: Vec<i8>,
    wanted: Vec<f64>,
    /// For the lead: pressures that the target alone asks for, and those of the period before.
    lead: Allocation,
    asked: Vec<f64>,
    before: Vec<f64>,
    started: bool,
    time: f64,
}

impl Controller {
    /// A controller whose model is `arm`.
    ///
    /// # Errors
    /// [`Error::Input`] for a number out of range or of the wrong size.
    pub fn new(arm: Arc<Arm>, parameters: ControllerParameters) -> Result<Self> {
        let ControllerParameters { period, lead_time, .. } = parameters;
        if !(period.is_finite() && period > 0.0) {
            return Err(Error::Input(format!(
                "controller: period is {period}; a positive number of seconds is needed"
            )));
        }
        if !(lead_time.is_finite() && lead_time >= 0.0) {
            return Err(Error::Input(format!(
                "controller: lead_time is {lead_time}; a number not below zero is needed"
            )));
        }
        parameters.limits.check(arm.body.inputs)?;
        let limits = &parameters.limits;
        Ok(Self {
            law: Law::new(&arm, period, parameters.law.clone())?,
            observer: Observer::new(arm.clone(), period, parameters.observer)?,
            allocation: Allocation::new(&arm, &limits.low, &limits.high, &limits.preferred),
            ws: Workspace::new(&arm),
            at_limit: vec![0; arm.body.inputs],
            wanted: vec![0.0; arm.body.inputs],
            lead: Allocation::new(&arm, &limits.low, &limits.high, &limits.preferred),
            asked: vec![0.0; arm.body.inputs],
            before: vec![0.0; arm.body.inputs],
            started: false,
            time: 0.0,
            parameters,
            arm,
        })
    }

    /// Begins anew.
    pub fn reset(&mut self) {
        self.observer.reset();
        self.allocation.reset();
        self.at_limit.fill(0);
        self.lead.reset();
        self.ws = Workspace::new(&self.arm);
        self.started = false;
        self.time = 0.0;
    }

    /// One period: from measured lengths (m) and pressures (Pa absolute) to commanded pressures `out`.
    ///
    /// # Errors
    /// [`Error::Convergence`] if the observer has no gain there, or where an estimate or a pressure is no longer finite, with
    /// the cause.
    pub fn step(&mut self, lengths: &[f64], pressures: &[f64], target: Target<'_>, out: &mut [f64]) -> Result<()> {
        if !self.started {
            self.law.reset(pressures);
        }
        self.observer.update(lengths, pressures)?;
        let (arm, ws) = (&*self.arm, &mut self.ws);
        // The model's effects may have hidden states (creep, hysteresis): they follow the estimate, period by period.
        let state = self.observer.state();
        if self.started {
            ws.effects.end_step(&arm.body, &arm.effects, self.time, state);
        }
        ws.effects.begin_step(&arm.body, self.time, state);
        ws.effects.time = self.time;
        self.time += self.parameters.period;
        let state =
            State { q: self.observer.lengths(), qd: self.observer.rates(), disturbance: self.observer.disturbance() };
        let wants = self.law.evaluate(arm, state, target, &self.at_limit, ws);
        let time = self.time - self.parameters.period;
        let not_finite = |what: &str| {
            Err(Error::Convergence(format!(
                "at t = {time} s {what} no longer finite although what is measured and estimated is: the gains are too high \
                 for this period, or the reference lies beyond what the model allows"
            )))
        };
        // The allocation would answer what is not a number with the pressures of the period before.
        let by_force = wants != Output::Pressures || self.law.adds_to_force();
        if by_force && !self.law.tau.iter().chain(&self.law.pose).all(|x| x.is_finite()) {
            return not_finite("the force that the controller wants is");
        }
        match wants {
            Output::Force => self.allocation.solve(arm, state.q, &self.law.tau, ws, &mut self.wanted),
            Output::ForceAtPose => self.allocation.solve(arm, &self.law.pose, &self.law.tau, ws, &mut self.wanted),
            Output::Pressures if self.law.adds_to_force() => {
                self.allocation.solve(arm, &self.law.pose, &self.law.tau, ws, &mut self.wanted);
                for (p, add) in self.wanted.iter_mut().zip(&self.law.pressures) {
                    *p += add;
                }
            }
            Output::Pressures => self.wanted.copy_from_slice(&self.law.pressures),
        }
        if !self.wanted.iter().all(|p| p.is_finite()) {
            return not_finite("the controller's pressures are");
        }
        let ControllerParameters { period, lead_time, limits, .. } = &self.parameters;
        let leads = *lead_time > 0.0 && self.law.feed_forward(arm, target, ws);
        if leads {
            self.lead.solve(arm, target.q, &self.law.tau, ws, &mut self.asked);
        }
        if !self.started {
            self.before.copy_from_slice(&self.asked);
            self.started = true;
        }
        for (j, p) in out.iter_mut().enumerate() {
            let (low, high, wanted) = (limits.low[j], limits.high[j], self.wanted[j]);
            *p = (wanted + lead_time / period * (self.asked[j] - self.before[j])).clamp(low, high);
            // Flags say what the law wants, not what the lead adds for a moment.
            self.at_limit[j] = i8::from(wanted >= high) - i8::from(wanted <= low);
        }
        self.before.copy_from_slice(&self.asked);
        Ok(())
    }

    /// Which inputs are at a limit: -1 lowest, 1 highest, 0 neither.
    pub fn at_limit(&self) -> &[i8] {
        &self.at_limit
    }

    /// The observer, for its estimates.
    pub fn observer(&self) -> &Observer {
        &self.observer
    }

    /// The control period, s.
    pub fn period(&self) -> f64 {
        self.parameters.period
    }

    /// The controller's model.
    pub fn arm(&self) -> &Arc<Arm> {
        &self.arm
    }
}
