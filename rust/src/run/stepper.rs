//! A plant that is stepped from outside.

use super::stepping::{Plan, Stepping};
use crate::arm::Arm;
use crate::dynamics::statics::rest;
use crate::error::{Error, Result};
use crate::integrate::{Integrator, Options};
use crate::plant::input::{Input, Interpolation};
use crate::plant::{Memory, Plant};
use std::sync::Arc;

/// A plant that is stepped from outside: a simulation in place of the real arm.
#[derive(Clone, Debug)]
pub struct Stepper {
    arm: Arc<Arm>,
    none: Arc<Input>,
    plant: Plant,
    integrator: Integrator<f64>,
    options: Options,
    pressures: Vec<f64>,
    /// As the sensors have them.
    lengths: Vec<f64>,
}

impl Stepper {
    /// The plant of `arm`, at rest under ambient pressure until [`Stepper::reset`], stepped as `plan` says.
    ///
    /// # Errors
    /// [`Error::Input`] for a step that is not positive, [`Error::Convergence`] if there is no rest.
    pub fn new(arm: Arc<Arm>, Plan { stepping, step }: Plan) -> Result<Self> {
        if !(step.is_finite() && step > 0.0) {
            return Err(Error::Input(format!("step: {step}; a positive number of seconds is needed")));
        }
        if stepping == Stepping::SymplecticEuler {
            return Err(Error::Input(format!(
                "method: {:?} is for environments; \"rk4\" or \"ros2\" are allowed here",
                stepping.name()
            )));
        }
        let p = vec![arm.body.ambient_pressure; arm.body.inputs];
        let none = Input::new(vec![0.0], (p.clone(), arm.body.inputs), (Vec::new(), 0), Interpolation::Hold)?;
        let q = rest(&arm, &p, None, &mut || false)?;
        let mut x = q.clone();
        x.resize(2 * q.len(), 0.0);
        let none = Arc::new(none);
        let plant = Plant::new(arm.clone(), none.clone()).with_pneumatics(0.0, &q);
        let options = plant.suited(Options { method: stepping.method(), step, ..Options::default() });
        let integrator = Integrator::new(options, 0.0, &x);
        let mut stepper = Self { arm, none, plant, integrator, options, pressures: p.clone(), lengths: q.clone() };
        stepper.reset(Some(&q), None, &p, &mut || false)?;
        Ok(stepper)
    }

    /// Time 0, lengths `q` (at rest under `p` if none), rates `qd` (zero if none), pressures `p` in all chambers.
    ///
    /// # Errors
    /// [`Error::Input`] for sizes or values that do not fit, [`Error::Convergence`] if there is no rest,
    /// [`Error::Interrupted`] if `stop` said so.
    pub fn reset(
        &mut self,
        q: Option<&[f64]>,
        qd: Option<&[f64]>,
        p: &[f64],
        stop: &mut impl FnMut() -> bool,
    ) -> Result<()> {
        let m = self.arm.coordinates();
        for (name, given, size) in [("q", q, m), ("qd", qd, m), ("p", Some(p), self.arm.body.inputs)] {
            if let Some(v) = given
                && (v.len() != size || v.iter().any(|x| !x.is_finite()))
            {
                return Err(Error::Input(format!("{name}: {size} finite numbers are needed, found {v:?}")));
            }
        }
        let mut x = match q {
            Some(q) => q.to_vec(),
            None => rest(&self.arm, p, None, stop)?,
        };
        let mut plant = Plant::new(self.arm.clone(), self.none.clone());
        plant.hold(p);
        self.plant = plant.with_pneumatics(0.0, &x);
        match qd {
            Some(qd) => x.extend_from_slice(qd),
            None => x.resize(2 * m, 0.0),
        }
        self.integrator = Integrator::new(self.options, 0.0, &x);
        self.plant.begin(0.0, &x);
        self.pressures.copy_from_slice(p);
        self.plant.measured_lengths_into(0.0, &x, &mut self.lengths);
        Ok(())
    }

    /// Everything that decides what comes next, as a row of numbers; for [`Stepper::set_state`] of the same arm.
    pub fn state(&self) -> Vec<f64> {
        let memory = self.plant.memory();
        let mut out = vec![self.integrator.time()];
        let pieces = [self.integrator.state(), &self.pressures, &self.lengths, &memory.numbers];
        pieces.iter().for_each(|piece| out.extend_from_slice(piece));
        for (times, rows) in [(&memory.inputs, &memory.pressures), (&memory.sensors, &memory.states)] {
            out.push(times.len() as f64);
            out.extend_from_slice(times);
            out.extend_from_slice(rows);
        }
        out
    }

    /// Goes on from what [`Stepper::state`] gave.
    ///
    /// # Errors
    /// [`Error::Input`] for numbers that are not those of this arm.
    pub fn set_state(&mut self, numbers: &[f64]) -> Result<()> {
        let (m, inputs) = (self.arm.coordinates(), self.arm.body.inputs);
        let misfit = || Error::Input("state: it does not fit this arm; take one that this arm gave".to_owned());
        if numbers.iter().any(|x| !x.is_finite()) {
            return Err(Error::Input("state: finite numbers are needed".to_owned()));
        }
        let mut rest = numbers;
        let mut take = |count: usize| -> Result<&[f64]> {
            let (piece, after) = rest.split_at_checked(count).ok_or_else(misfit)?;
            rest = after;
            Ok(piece)
        };
        let time = take(1)?[0];
        let (x, p, lengths) = (take(2 * m)?, take(inputs)?, take(m)?);
        let fixed = self.plant.memory().numbers.len();
        let mut memory = Memory { numbers: take(fixed)?.to_vec(), ..Memory::default() };
        for (times, rows, width) in
            [(&mut memory.inputs, &mut memory.pressures, inputs), (&mut memory.sensors, &mut memory.states, 2 * m)]
        {
            let count = take(1)?[0] as usize;
            *times = take(count)?.to_vec();
            *rows = take(count.checked_mul(width).ok_or_else(misfit)?)?.to_vec();
        }
        if !rest.is_empty() {
            return Err(misfit());
        }
        let (q, qd) = x.split_at(m);
        let mut next = self.clone();
        next.reset(Some(q), Some(qd), p, &mut || false)?;
        next.integrator.set_time(time);
        next.plant.resume(time, &memory)?;
        next.pressures.copy_from_slice(p);
        next.lengths.copy_from_slice(lengths);
        *self = next;
        Ok(())
    }

    /// Holds the pressures `p` for `dt` s. Nothing is allocated. `stop` is asked now and then.
    ///
    /// # Errors
    /// [`Error::Simulation`] if the motion cannot be gone on with, [`Error::Input`] for a pressure that is not finite,
    /// [`Error::Interrupted`] if `stop` said so: the plant then stands somewhere within the step.
    pub fn step(&mut self, p: &[f64], dt: f64, stop: &mut impl FnMut() -> bool) -> Result<()> {
        if let Some(j) = p.iter().position(|x| !x.is_finite()) {
            return Err(Error::Input(format!("pressure {} is {}; finite numbers are needed", j + 1, p[j])));
        }
        self.plant.hold(p);
        let end = self.integrator.time() + dt;
        self.integrator.run(&mut self.plant, &[end], &mut |_, _| {}, stop)?;
        self.plant.chamber_pressures.clear();
        let x = self.integrator.state();
        self.plant.chamber_pressures_into(self.integrator.time(), &x[..self.lengths.len()], &mut self.pressures);
        self.plant.measured_lengths_into(self.integrator.time(), x, &mut self.lengths);
        Ok(())
    }

    /// Time since the reset, s.
    pub fn time(&self) -> f64 {
        self.integrator.time()
    }

    /// Lengths, m.
    pub fn lengths(&self) -> &[f64] {
        &self.integrator.state()[..self.arm.coordinates()]
    }

    /// Rates, m/s.
    pub fn rates(&self) -> &[f64] {
        &self.integrator.state()[self.arm.coordinates()..2 * self.arm.coordinates()]
    }

    /// Lengths as their sensors have them, m: the true ones where no effect acts on sensors.
    pub fn measured_lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// Pressures in the chambers, Pa absolute: what sensors of pressure see.
    pub fn pressures(&self) -> &[f64] {
        &self.pressures
    }

    /// The arm.
    pub fn arm(&self) -> &Arc<Arm> {
        &self.arm
    }
}
