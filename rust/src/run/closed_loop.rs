//! The loop: plant with its pneumatics, sensors with noise, a controller, and the record of it all.
//!
//! Order in a period: measure at t_k, ask the controller, hold its pressures (as commands to the pneumatics) until t_{k+1}.
//! The plant is an arm of its own; the controller's model need not be the same.

use super::stepper::Stepper;
use crate::control::Target;
use crate::dynamics::Workspace;
use crate::effects::poses;
use crate::error::{Error, Result};
use crate::kinematics::chain::pass;
use crate::kinematics::link::Motion;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

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
