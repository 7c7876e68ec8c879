//! Derivatives of a trajectory by its initial state and by numbers of the arm.
//!
//! Source: forward sensitivities by dual numbers through the integrator itself, so they are the exact derivatives of the
//! computed trajectory (Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, sec. I.14). Directions go
//! over threads, a few a pass.
//! Limits: an adaptive method's step sizes count as constants. Where the input jumps at a time that depends on a parameter
//! (a delay), the derivative at the jump is missing.

use crate::arm::Arm;
use crate::arm::structure::with_tangents;
use crate::error::{Error, Result};
use crate::integrate::{Integrator, Options};
use crate::plant::Plant;
use crate::plant::input::Input;
use crate::plant::stiffness::chosen;
use crate::real::Dual;
use crate::run::watch::watched;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::available_parallelism;

/// What varies: the numbers of the arm and the initial state, together.
#[derive(Clone, Copy, Debug)]
pub struct Direction<'a> {
    /// Derivatives of the arm's numbers (see [`crate::arm::structure::tangent`]), or nothing.
    pub tangent: &'a [f64],
    /// Derivative of the initial lengths and rates, 6n.
    pub state: &'a [f64],
}

/// A trajectory to differentiate.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// Its input.
    pub input: &'a Arc<Input>,
    /// How to integrate.
    pub options: Options,
    /// Start, s.
    pub start: f64,
    /// Lengths and rates at the start, 6n.
    pub state: &'a [f64],
    /// Times of the rows, ascending, s.
    pub times: &'a [f64],
}

/// Directions a pass. In ordinary numbers and not in lanes: a whole plant over dual numbers of lanes takes a minute to compile.
const WIDTH: usize = 4;

impl Trajectory<'_> {
    /// States at the times, 6n a row, and their derivatives, the rows of one direction after those of the other.
    ///
    /// # Errors
    /// [`Error::Input`] for sizes that do not fit; [`Error::Simulation`] where the run cannot go on; [`Error::Interrupted`]
    /// if `watch` said so, which is asked now and then.
    pub fn differentiate(
        &self,
        directions: &[Direction<'_>],
        watch: &mut impl FnMut() -> bool,
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        // Chamber pressures are states of their own; without them the derivatives would be quietly wrong.
        if self.arm.pneumatics.is_some() {
            let text = "sensitivities: an arm with pneumatics is not supported; take its pneumatics away";
            return Err(Error::Input(text.to_owned()));
        }
        let size = 2 * self.arm.coordinates();
        if self.state.len() != size || directions.iter().any(|d| d.state.len() != size) {
            return Err(Error::Input(format!("initial state and its derivatives: {size} numbers are needed")));
        }
        if self.times.windows(2).any(|w| w[1] < w[0]) || self.times.first().is_some_and(|t| *t < self.start) {
            return Err(Error::Input(format!("output times must ascend and not lie before {} s", self.start)));
        }
        let none = [Direction { tangent: &[], state: &[] }];
        let directions = if directions.is_empty() { &none[..0] } else { directions };
        let chunks: Vec<_> = if directions.is_empty() { vec![directions] } else { directions.chunks(WIDTH).collect() };
        let stop = AtomicBool::new(false);
        // Chosen once, so that all directions are of one trajectory.
        let arm = Arc::new(self.arm.clone());
        let options = chosen(self.options, &arm, self.input, self.start - self.input.origin(), self.state);
        let trajectory = &Self { options, ..*self };
        let part = |chunk| Part { trajectory, directions: chunk, stop: &stop };
        // Threads of this call: those of the process are missing in a child that was forked.
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(available_parallelism().map_or(1, usize::from).min(chunks.len()))
            .build()
            .map_err(|e| Error::Input(format!("threads for sensitivities: {e}")))?;
        let work = || threads.install(|| chunks.into_par_iter().map(|c| part(c).run()).collect::<Result<Vec<_>>>());
        let parts = watched(&stop, work, watch)?;
        let mut parts = parts.into_iter();
        let (rows, mut out) = parts.next().unwrap_or_default();
        for (_, more) in parts {
            out.extend(more);
        }
        Ok((rows, out))
    }
}

/// Some directions of a trajectory, not more than one pass takes.
struct Part<'a> {
    trajectory: &'a Trajectory<'a>,
    directions: &'a [Direction<'a>],
    stop: &'a AtomicBool,
}

impl Part<'_> {
    fn run(&self) -> Result<(Vec<f64>, Vec<f64>)> {
        let Trajectory { arm, input, options, start, state, times, .. } = *self.trajectory;
        let origin = input.origin();
        let start = start - origin;
        let times: Vec<f64> = times.iter().map(|t| t - origin).collect();
        let zeros;
        let lifted = if self.directions.iter().any(|d| !d.tangent.is_empty()) {
            let count = self.directions.iter().map(|d| d.tangent.len()).max().unwrap_or(0);
            zeros = vec![0.0; count];
            let tangents: Vec<&[f64]> = self
                .directions
                .iter()
                .map(|d| if d.tangent.is_empty() { zeros.as_slice() } else { d.tangent })
                .collect();
            with_tangents::<WIDTH, f64>(arm, &tangents)
        } else {
            arm.lift()
        };
        let seed = |j: usize| Dual::seeded(state[j], |d| self.directions.get(d).map_or(0.0, |d| d.state[j]));
        let x0: Vec<Dual<WIDTH>> = (0..state.len()).map(seed).collect();
        let mut plant = Plant::new(Arc::new(lifted), input.clone());
        plant.begin(start, &x0);
        let (rows, size) = (times.len(), state.len());
        let mut values = vec![0.0; rows * size];
        let mut derivatives = vec![0.0; self.directions.len() * rows * size];
        let mut integrator = Integrator::new(options, start, &x0);
        let block = rows * size;
        let mut row = 0;
        let mut sink = |_: f64, x: &[Dual<WIDTH>]| {
            for (j, x) in x.iter().enumerate() {
                values[row * size + j] = x.value;
                for (d, rows) in derivatives.chunks_mut(block).enumerate() {
                    rows[row * size + j] = x.along(d);
                }
            }
            row += 1;
        };
        integrator
            .run(&mut plant, &times, &mut sink, &mut || self.stop.load(Ordering::Relaxed))
            .map_err(|e| e.on_clock(origin))?;
        Ok((values, derivatives))
    }
}
