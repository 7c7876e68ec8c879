//! An arm simulated under an input: initial rest, integration, rows of output.

use crate::arm::Arm;
use crate::dynamics::Workspace;
use crate::dynamics::statics::static_lengths;
use crate::effects;
use crate::error::{Error, Result};
use crate::forces::{External, PointWrench};
use crate::integrate::{Integrator, Method, Options, Statistics};
use crate::kinematics::point::Point;
use crate::plant::Plant;
use crate::plant::input::{Cursor, Input};
use crate::plant::stiffness::{chosen, explained};
use crate::real::linear::Vec3;
use std::sync::Arc;

/// A simulation under way; [`Simulation::advance`] may be called again and again.
#[derive(Clone, Debug)]
pub struct Simulation {
    plant: Plant,
    input: Arc<Input>,
    integrator: Integrator<f64>,
    options: Options,
    /// Time (on the input's clock) and state that it began with.
    start: (f64, Vec<f64>),
    ws: Workspace,
    cursor: Cursor,
}

/// Rows of output at the times asked for; fewer if the run ended early.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Lengths, 3n a row, m.
    pub lengths: Vec<f64>,
    /// Their rates, 3n a row, m/s.
    pub velocities: Vec<f64>,
    /// Pressures in the chambers, one an input a row, Pa.
    pub pressures: Vec<f64>,
    /// Origins of the heads in the world, 3n a row, m.
    pub head_positions: Vec<f64>,
    /// Orientations of the heads: unit quaternions (w, x, y, z) with w >= 0, 4n a row.
    pub head_orientations: Vec<f64>,
    /// Lengths as their sensors have them, 3n a row, m; empty where no effect acts on sensors.
    pub measured_lengths: Vec<f64>,
    /// Origins of the heads as they are measured, 3n a row, m; empty where no effect acts on measured heads.
    pub measured_head_positions: Vec<f64>,
    /// Orientations as they are measured, 4n a row; likewise.
    pub measured_head_orientations: Vec<f64>,
    /// Number of rows.
    pub count: usize,
}

impl Simulation {
    /// The arm at time `start` with lengths `q` and rates `qd`: at rest under the first pressures and forces if not given.
    /// Where lengths are given, what the input says before `start` counts for pressures that lag ([`Plant::preceded`]).
    ///
    /// # Errors
    /// [`Error::Input`] for sizes that do not fit, [`Error::Convergence`] if there is no rest to start from.
    pub fn new(
        arm: Arc<Arm>,
        input: Arc<Input>,
        options: Options,
        start: f64,
        q: Option<&[f64]>,
        qd: Option<&[f64]>,
    ) -> Result<Self> {
        let start = start - input.origin();
        let x = initial_state(&arm, &input, start, q, qd)?;
        let ws = Workspace::new(&arm);
        let (n, cursor) = (arm.coordinates(), Cursor::default());
        let options = chosen(options, &arm, &input, start, &x);
        let plant = Plant::new(arm, input.clone());
        let plant = if q.is_some() { plant.preceded() } else { plant };
        let mut plant = plant.with_pneumatics(start, &x[..n]);
        let options = plant.suited(options);
        plant.begin(start, &x);
        let integrator = Integrator::new(options, start, &x).keeping();
        Ok(Self { integrator, plant, input, options, start: (start, x), ws, cursor })
    }

    /// The same from where what bellows remember stands as [`Plant::moved`] says; before it goes on.
    pub fn moved(mut self, moved: Vec<f64>) -> Self {
        self.plant = self.plant.moved(moved);
        self.plant.begin(self.start.0, &self.start.1);
        self
    }

    /// Notes where steps end, for [`Simulation::noted`].
    pub fn noting(self) -> Self {
        Self { integrator: self.integrator.noting(), ..self }
    }

    /// Takes the steps of another simulation, which ended at `ends` (on the input's clock).
    pub fn following(self, ends: Arc<Vec<f64>>) -> Self {
        Self { integrator: self.integrator.following(ends), ..self }
    }

    /// The ends of the steps, if they were noted, on the input's clock.
    pub fn noted(self) -> Vec<f64> {
        self.integrator.noted()
    }

    /// The method in use.
    pub fn method(&self) -> Method {
        self.options.method
    }

    /// Goes on to the last of `times` (on the caller's clock, ascending, not before the present time) and returns a row at
    /// each.
    ///
    /// The rows computed before a failure are returned beside the error. `stop` is asked now and then.
    pub fn advance(&mut self, times: &[f64], stop: &mut impl FnMut() -> bool) -> (Rows, Result<()>) {
        let Self { plant, input, integrator, ws, cursor, options, start } = self;
        let origin = input.origin();
        let arm = plant.arm.clone();
        let n = arm.coordinates();
        let commanded = !plant.has_pneumatics();
        let mut rows = Rows {
            lengths: Vec::with_capacity(times.len() * n),
            velocities: Vec::with_capacity(times.len() * n),
            pressures: Vec::with_capacity(times.len() * arm.body.inputs),
            head_positions: Vec::with_capacity(times.len() * n),
            head_orientations: Vec::with_capacity(times.len() * n / 3 * 4),
            ..Rows::default()
        };
        let mut last = vec![0.0; 2 * n];
        let mut result = Ok(());
        for time in times {
            let time = *time - origin;
            let mut sink = |t: f64, x: &[f64]| {
                rows.lengths.extend_from_slice(&x[..n]);
                rows.velocities.extend_from_slice(&x[n..2 * n]);
                if commanded {
                    let place = input.weight(t, false, cursor);
                    rows.pressures.extend((0..arm.body.inputs).map(|j| input.pressure(place, j)));
                }
                effects::poses::seen(&arm.body, &arm.effects, &x[..n], &mut ws.links, |_, head| {
                    rows.head_positions.extend(head.position.0);
                    rows.head_orientations.extend(head.quaternion());
                });
                rows.count += 1;
                last.copy_from_slice(x);
            };
            result = integrator.run(plant, &[time], &mut sink, stop);
            if result.is_err() {
                break;
            }
            if plant.has_sensors() {
                let start = rows.measured_lengths.len();
                rows.measured_lengths.resize(start + n, 0.0);
                plant.measured_lengths_into(time, &last, &mut rows.measured_lengths[start..]);
            }
            if plant.changes_heads() {
                plant.measured_heads(time, &last, &mut ws.links, |_, head| {
                    rows.measured_head_positions.extend(head.position.0);
                    rows.measured_head_orientations.extend(head.quaternion());
                });
            }
        }
        if !commanded {
            rows.pressures = std::mem::take(&mut plant.chamber_pressures);
        }
        let explain = |e: Error| explained(e, *options, &arm, input, start.0, &start.1).on_clock(origin);
        (rows, result.map_err(explain))
    }

    /// Counts so far.
    pub fn statistics(&self) -> Statistics {
        self.integrator.statistics()
    }

    /// Whether no output can be given any more at `t`.
    pub fn is_past(&self, t: f64) -> bool {
        t - self.input.origin() < self.integrator.earliest()
    }

    /// The earliest time at which output can still be given, s: the start of the last step.
    pub fn earliest(&self) -> f64 {
        self.integrator.earliest() + self.input.origin()
    }

    /// End of the last step, s.
    pub fn time(&self) -> f64 {
        self.integrator.time() + self.input.origin()
    }
}

/// Lengths and rates at `start` (on the input's clock): as given, else at rest under the pressures and forces of that time.
///
/// # Errors
/// [`Error::Input`] for sizes that do not fit, [`Error::Convergence`] if there is no rest to start from.
pub(crate) fn initial_state(
    arm: &Arm,
    input: &Input,
    start: f64,
    q: Option<&[f64]>,
    qd: Option<&[f64]>,
) -> Result<Vec<f64>> {
    let n = arm.coordinates();
    let place = input.weight(start, false, &mut Cursor::default());
    if let Some(point) = input.points().iter().find(|point| point.section >= n / 3) {
        let (found, count) = (point.section + 1, n / 3);
        return Err(Error::Input(format!("a wrench on section {found}; sections 1 to {count} exist")));
    }
    for (name, given) in [("q", q), ("qd", qd)] {
        if let Some(v) = given
            && (v.len() != n || v.iter().any(|x| !x.is_finite()))
        {
            return Err(Error::Input(format!("initial {name}: {n} finite numbers are needed, found {v:?}")));
        }
    }
    let rest;
    let q = match q {
        Some(q) => q,
        None => {
            let mut p: Vec<f64> = (0..arm.body.inputs).map(|j| input.pressure(place, j)).collect();
            effects::pressures::at_rest(&arm.effects, &mut p);
            let force = |first: usize| Vec3([0, 1, 2].map(|k| input.force(place, first + k)));
            let count = input.section_force_count();
            let forces: Vec<_> = (0..count).step_by(3).map(force).collect();
            let wrench = |(j, point): (usize, &Point<f64>)| {
                let first = count + 6 * j;
                PointWrench { point: *point, force: force(first), moment: force(first + 3) }
            };
            let wrenches: Vec<_> = input.points().iter().enumerate().map(wrench).collect();
            let outside = input.has_forces().then_some(External { forces: &forces, wrenches: &wrenches });
            rest = static_lengths(arm, &p, outside, None)?;
            &rest
        }
    };
    let mut x = q.to_vec();
    x.extend_from_slice(qd.unwrap_or(&vec![0.0; n]));
    Ok(x)
}
