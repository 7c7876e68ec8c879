//! Motion and rest of the virtual arm: a Runge-Kutta loop of its own, fixed step, and a plain Newton iteration.
//!
//! Source: the classical method of fourth order (Kutta 1901); Newton's method with differences for derivatives.

use super::VirtualArm;
use super::arc::PSI_MAX;
use super::equations::Actions;
use crate::error::{Error, Result};
use crate::plant::input::{Cursor, Input};
use nalgebra::{DMatrix, DVector, Vector3};

/// Steps between two questions whether to stop.
const STEPS_BETWEEN_QUESTIONS: u64 = 500;

/// A state: lengths, their rates, creep states.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Lengths, m.
    pub lengths: Vec<f64>,
    /// Their rates, m/s.
    pub velocities: Vec<f64>,
    /// Elongations of the creep branches' springs, m, branch by branch for each bellows.
    pub creep: Vec<f64>,
}

/// States at the output times, row by row.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Lengths, m.
    pub lengths: Vec<f64>,
    /// Their rates, m/s.
    pub velocities: Vec<f64>,
    /// Creep states, m.
    pub creep: Vec<f64>,
}

/// Reads the sampled input.
struct Reader<'a> {
    input: &'a Input,
    cursor: Cursor,
    pressures: Vec<f64>,
    external: Vec<Vector3<f64>>,
}

impl Reader<'_> {
    /// The values at `t`; `before`: of a jump at `t` the value before it.
    fn read(&mut self, t: f64, before: bool) -> Actions<'_> {
        let place = self.input.weight(t, before, &mut self.cursor);
        for (k, p) in self.pressures.iter_mut().enumerate() {
            *p = self.input.pressure(place, k);
        }
        for (i, f) in self.external.iter_mut().enumerate() {
            *f = Vector3::from_fn(|k, _| self.input.force(place, 3 * i + k));
        }
        Actions { pressures: &self.pressures, external: &self.external }
    }
}

impl VirtualArm {
    /// Runs from `start` at the first of `times` (ascending) and returns a row at each of them.
    ///
    /// `step`: longest step, s; steps end on every output time and on every jump of the input. `interrupted` is asked
    /// every so often.
    ///
    /// # Errors
    /// [`Error::Simulation`] if the motion leaves the range of validity, [`Error::Interrupted`].
    pub fn run(
        &self,
        input: &Input,
        times: &[f64],
        start: &State,
        step: f64,
        interrupted: &mut dyn FnMut() -> bool,
    ) -> Result<Rows> {
        let n = self.coordinates();
        let mut y: Vec<f64> = self.arcs(&start.lengths);
        y.extend(self.arcs(&start.velocities));
        y.extend(&start.creep);
        let external = if input.has_forces() { vec![Vector3::zeros(); self.sections.len()] } else { Vec::new() };
        let mut reader = Reader { input, cursor: Cursor::default(), pressures: vec![0.0; self.inputs], external };
        let mut rows = Rows::default();
        let Some(&first) = times.first() else { return Ok(rows) };
        let (mut t, mut count) = (first, 0_u64);
        for &output in times {
            while t < output {
                let until = output.min(input.next_jump(t));
                // The quotient's rounding must not cost a step: 10 ms are ten steps of 1 ms.
                let steps = ((until - t) / step - 1e-9).ceil().max(1.0);
                let (from, h) = (t, (until - t) / steps);
                for k in 0..steps as u64 {
                    let t0 = from + k as f64 * h;
                    self.step(&mut reader, t0, h, &mut y);
                    count += 1;
                    if count.is_multiple_of(STEPS_BETWEEN_QUESTIONS) && interrupted() {
                        return Err(Error::Interrupted);
                    }
                    if let Some(reason) = self.objection(&y) {
                        return Err(Error::Simulation { time: t0, reason });
                    }
                }
                t = until;
            }
            rows.lengths.extend(self.lengths(&y[..n]));
            rows.velocities.extend(self.lengths(&y[n..2 * n]));
            rows.creep.extend(&y[2 * n..]);
        }
        Ok(rows)
    }

    /// One step of the classical Runge-Kutta method.
    fn step(&self, reader: &mut Reader<'_>, t: f64, h: f64, y: &mut [f64]) {
        let at = |k: &[f64], a: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + a * k).collect() };
        let k1 = self.derivative(y, reader.read(t, false));
        let k2 = self.derivative(&at(&k1, 0.5 * h), reader.read(t + 0.5 * h, false));
        let k3 = self.derivative(&at(&k2, 0.5 * h), reader.read(t + 0.5 * h, false));
        let k4 = self.derivative(&at(&k3, h), reader.read(t + h, true));
        for i in 0..y.len() {
            y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        }
    }

    /// y' of y = (x, x', z).
    fn derivative(&self, y: &[f64], actions: Actions<'_>) -> Vec<f64> {
        let n = self.coordinates();
        let (x, xd, z) = (&y[..n], &y[n..2 * n], &y[2 * n..]);
        let equations = self.equations(x, xd, z, actions);
        let acceleration = match equations.inertia.cholesky() {
            Some(factor) => factor.solve(&equations.force),
            // Not finite: the objection after the step ends the run.
            None => DVector::from_element(n, f64::NAN),
        };
        let mut out = Vec::with_capacity(y.len());
        out.extend(xd);
        out.extend(acceleration.iter());
        for (i, b, first) in self.each_bellows() {
            let rate = b.length(&xd[3 * i..3 * i + 3]);
            out.extend(self.creep.iter().enumerate().map(|(k, c)| rate - z[first + k] / c.time_constant));
        }
        out
    }

    fn objection(&self, y: &[f64]) -> Option<String> {
        for (i, arc) in y[..self.coordinates()].chunks_exact(3).enumerate() {
            let straight = arc[0] * arc[0] + arc[1] * arc[1] <= PSI_MAX * PSI_MAX;
            if !straight || arc[2].is_nan() || arc[2] <= 0.0 {
                return Some(format!(
                    "section {} of the virtual arm is at (u, v, l) = {arc:?}; bending up to {PSI_MAX} rad and a \
                     positive length are allowed, check pressures and step",
                    i + 1
                ));
            }
        }
        None
    }

    /// The state of rest under constant pressures and forces, all creep relaxed.
    ///
    /// # Errors
    /// [`Error::Convergence`] if none is found.
    pub fn rest(&self, pressures: &[f64], external: &[[f64; 3]]) -> Result<State> {
        let n = self.coordinates();
        let external: Vec<_> = external.iter().map(|f| Vector3::from(*f)).collect();
        let actions = Actions { pressures, external: &external };
        let (zero, relaxed) = (vec![0.0; n], vec![0.0; self.creep_states()]);
        let force = |x: &DVector<f64>| self.equations(x.as_slice(), &zero, &relaxed, actions).force;
        let mut x =
            DVector::from_fn(n, |k, _| if k % 3 == 2 { self.sections[k / 3].bellows[0].rest_length } else { 0.0 });
        for _ in 0..200 {
            let f = force(&x);
            let mut derivative = DMatrix::zeros(n, n);
            for k in 0..n {
                let difference = 1e-6;
                let mut moved = x.clone();
                moved[k] += difference;
                let mut up = force(&moved);
                moved[k] -= 2.0 * difference;
                up -= force(&moved);
                derivative.set_column(k, &(up / (2.0 * difference)));
            }
            let Some(step) = derivative.lu().solve(&-f) else { break };
            let largest = step.amax();
            // Radians and metres alike: far from rest, walk instead of jump.
            x += step * (0.1 / largest.max(0.1));
            if largest < 1e-12 {
                let velocities = zero.clone();
                return Ok(State { lengths: self.lengths(x.as_slice()), velocities, creep: relaxed });
            }
        }
        Err(Error::Convergence(format!(
            "the virtual arm has no rest near its rest lengths; a generalized force of {:.3e} is left",
            force(&x).amax()
        )))
    }
}
