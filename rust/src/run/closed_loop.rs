//! The loop: plant with its pneumatics, sensors with noise, a controller, and the record of it all.
//!
//! Order in a period: measure at t_k, ask the controller, hold its pressures (as commands to the pneumatics) until t_{k+1}.
//! The plant is an arm of its own; the controller's model need not be the same.

use crate::arm::Arm;
use crate::control::{Allocation, Limits, Target, law};
use crate::dynamics::Workspace;
use crate::dynamics::statics::rest;
use crate::effects::poses;
use crate::error::{Error, Result};
use crate::integrate::{Integrator, Options};
use crate::kinematics::chain::{Motion, pass};
use crate::plant::input::{Input, Interpolation};
use crate::plant::{Memory, Plant};
use crate::run::stepping::{Plan, Stepping};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
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

/// Pressures under which `arm` rests nearest to lengths `q` within limits, and the lengths at which it then rests.
///
/// # Errors
/// [`Error::Convergence`] if there is no rest, [`Error::Interrupted`] if `stop` said so.
pub fn rest_near(
    arm: &Arm,
    q: &[f64],
    limits: &Limits,
    stop: &mut impl FnMut() -> bool,
) -> Result<(Vec<f64>, Vec<f64>)> {
    limits.check(arm.body.inputs)?;
    let mut ws = Workspace::new(arm);
    let (mut tau, mut p) = (vec![0.0; q.len()], vec![0.0; arm.body.inputs]);
    law::static_force(arm, q, &vec![0.0; q.len()], &mut ws, &mut tau);
    Allocation::new(arm, &limits.low, &limits.high, &limits.preferred).solve(arm, q, &tau, &mut ws, &mut p);
    let lengths = rest(arm, &p, Some(q), stop)?;
    Ok((p, lengths))
}

/// What the sensors add to the truth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensors {
    /// Standard deviation of measured lengths, m.
    pub length_noise: f64,
    /// Standard deviation of measured pressures, Pa.
    pub pressure_noise: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Where the arm should be, period by period; after the last row that one holds, at rest.
#[derive(Clone, Debug)]
pub struct Reference {
    rows: Vec<f64>,
    coordinates: usize,
}

impl Reference {
    /// Rows of (q, q', q''), 3m numbers each.
    ///
    /// # Errors
    /// [`Error::Input`] if there are none, or numbers that do not fit.
    pub fn new(rows: Vec<f64>, coordinates: usize) -> Result<Self> {
        if rows.is_empty() || !rows.len().is_multiple_of(3 * coordinates) {
            return Err(Error::Input(format!("reference: rows of {} numbers are needed", 3 * coordinates)));
        }
        if let Some(k) = rows.iter().position(|x| !x.is_finite()) {
            return Err(Error::Input(format!("reference: row {} holds {}", k / (3 * coordinates), rows[k])));
        }
        Ok(Self { rows, coordinates })
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len() / (3 * self.coordinates)
    }

    /// Whether there are no rows (never: [`Reference::new`] refuses).
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The target of period `k`.
    pub fn target(&self, k: usize) -> Target<'_> {
        let m = self.coordinates;
        let row = &self.rows[k.min(self.len() - 1) * 3 * m..][..3 * m];
        Target { q: &row[..m], qd: &row[m..2 * m], qdd: &row[2 * m..] }
    }
}

/// Rows of a closed loop, one a period, at the moment of measurement.
#[derive(Clone, Debug, Default)]
pub struct LoopRows {
    /// Lengths, m.
    pub lengths: Vec<f64>,
    /// Rates, m/s.
    pub velocities: Vec<f64>,
    /// Pressures in the chambers, Pa.
    pub pressures: Vec<f64>,
    /// Commanded pressures from then on, Pa.
    pub commands: Vec<f64>,
    /// Estimated rates, m/s; NaN where the controller has none.
    pub estimated_velocities: Vec<f64>,
    /// -1, 0, 1 for each input: at its lowest, between, at its highest.
    pub at_limit: Vec<i8>,
    /// Origins of the heads, m.
    pub head_positions: Vec<f64>,
    /// Number of rows.
    pub count: usize,
}

/// What a controller is asked and what it answers in a period.
#[derive(Debug)]
pub struct Exchange<'a> {
    /// Period.
    pub index: usize,
    /// Time, s.
    pub time: f64,
    /// Measured lengths, m, then measured pressures, Pa absolute.
    pub measured: &'a [f64],
    /// Where the arm should be.
    pub target: Target<'a>,
    /// Answer: pressures, Pa absolute.
    pub command: &'a mut [f64],
    /// Answer, for the record: estimated rates, m/s.
    pub estimated_velocities: &'a mut [f64],
    /// Answer, for the record: inputs at a limit.
    pub at_limit: &'a mut [i8],
}

/// Runs the loop over `count` periods of `period` s from the stepper's present state. Rows until a failure are kept.
///
/// `control` answers an [`Exchange`]; `stop` is asked every period and now and then within. `decimation`: every how many periods a row is recorded.
pub fn run(
    stepper: &mut Stepper,
    sensors: Sensors,
    reference: &Reference,
    (period, count, decimation): (f64, usize, usize),
    control: &mut impl FnMut(Exchange<'_>) -> Result<()>,
    stop: &mut impl FnMut() -> bool,
) -> (LoopRows, Result<()>) {
    let arm = stepper.arm().clone();
    let (m, inputs) = (arm.coordinates(), arm.body.inputs);
    let kept = count / decimation.max(1) + 1;
    let mut rows = LoopRows {
        lengths: Vec::with_capacity(kept * m),
        velocities: Vec::with_capacity(kept * m),
        pressures: Vec::with_capacity(kept * inputs),
        commands: Vec::with_capacity(kept * inputs),
        estimated_velocities: Vec::with_capacity(kept * m),
        at_limit: Vec::with_capacity(kept * inputs),
        head_positions: Vec::with_capacity(kept * m),
        count: 0,
    };
    let mut noise = Xoshiro256PlusPlus::seed_from_u64(sensors.seed);
    let mut ws = Workspace::new(&arm);
    let mut measured = vec![0.0; m + inputs];
    let mut command = stepper.pressures().to_vec();
    let mut estimated = vec![f64::NAN; m];
    let mut at_limit = vec![0_i8; inputs];
    for index in 0..count {
        for (k, y) in measured.iter_mut().enumerate() {
            let (truth, deviation) = match k.checked_sub(m) {
                None => (stepper.measured_lengths()[k], sensors.length_noise),
                Some(j) => (stepper.pressures()[j], sensors.pressure_noise),
            };
            let normal: f64 = StandardNormal.sample(&mut noise);
            *y = truth + deviation * normal;
        }
        let asked = control(Exchange {
            index,
            time: stepper.time(),
            measured: &measured,
            target: reference.target(index),
            command: &mut command,
            estimated_velocities: &mut estimated,
            at_limit: &mut at_limit,
        });
        if let Err(error) = asked {
            return (rows, Err(error));
        }
        if index.is_multiple_of(decimation.max(1)) {
            rows.lengths.extend_from_slice(stepper.lengths());
            rows.velocities.extend_from_slice(stepper.rates());
            rows.pressures.extend_from_slice(stepper.pressures());
            rows.commands.extend_from_slice(&command);
            rows.estimated_velocities.extend_from_slice(&estimated);
            rows.at_limit.extend_from_slice(&at_limit);
            pass(&arm.body, stepper.lengths(), &[], Motion::Pose, &mut ws.links);
            poses::heads(&arm.body, &arm.effects, &ws.links, |head| rows.head_positions.extend(head.position.0));
            rows.count += 1;
        }
        if let Err(error) = stepper.step(&command, period, stop) {
            return (rows, Err(error));
        }
        if stop() {
            return (rows, Err(Error::Interrupted));
        }
    }
    (rows, Ok(()))
}
