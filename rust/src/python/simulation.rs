//! The class `Simulation`: a run that can be advanced piece by piece.

use super::arm::PyArm;
use super::arrays::{any_vector, rows, shaped, vector};
use super::errors::{input, to_python};
use crate::error::Error;
use crate::input::{Input, Interpolation};
use crate::integrate::{Method, Options};
use crate::simulate::Simulation;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

/// A simulation under way.
#[pyclass(name = "Simulation", module = "bha._core", frozen)]
pub struct PySimulation {
    simulation: Mutex<Simulation>,
    sections: usize,
    inputs: usize,
}

type Block<'py> = Bound<'py, PyArray2<f64>>;

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (arm, times, pressures, forces = None, *, interpolation = "linear", method = "dopri5", step = 1e-3, rtol = 1e-6, atol = 1e-8, min_step = 1e-10, max_step = f64::INFINITY, max_steps = None, start = None, q = None, qd = None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        arm: &Bound<'_, PyArm>,
        times: &Bound<'_, PyAny>,
        pressures: &Bound<'_, PyAny>,
        forces: Option<&Bound<'_, PyAny>>,
        interpolation: &str,
        method: &str,
        step: f64,
        rtol: f64,
        atol: f64,
        min_step: f64,
        max_step: f64,
        max_steps: Option<u64>,
        start: Option<f64>,
        q: Option<&Bound<'_, PyAny>>,
        qd: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = arm.py();
        let arm = arm.get().arm.clone();
        let (sections, inputs) = (arm.sections.len(), arm.inputs);
        let interpolation = interpolation_by_name(py, interpolation)?;
        let options = options(py, method, step, (rtol, atol), (min_step, max_step), max_steps)?;
        let times = any_vector(times, "times")?.as_slice()?.to_vec();
        let pressures = rows(pressures, "pressures", inputs)?.as_slice()?.to_vec();
        let forces = forces.map(|f| rows(f, "forces", 3 * sections)).transpose()?;
        let forces = match &forces {
            Some(f) => (f.as_slice()?.to_vec(), 3 * sections),
            None => (Vec::new(), 0),
        };
        let q = q.map(|q| vector(q, "q", 3 * sections)).transpose()?;
        let qd = qd.map(|q| vector(q, "qd", 3 * sections)).transpose()?;
        let build = || {
            let input = Input::new(times, (pressures, inputs), forces, interpolation)?;
            let start = start.unwrap_or(input.start());
            if !start.is_finite() {
                return Err(Error::Input(format!("start: {start}; a finite time is needed")));
            }
            let q = q.as_ref().map(|q| q.as_slice()).transpose().map_err(|e| Error::Input(e.to_string()))?;
            let qd = qd.as_ref().map(|q| q.as_slice()).transpose().map_err(|e| Error::Input(e.to_string()))?;
            Simulation::new(arm, Arc::new(input), options, start, q, qd)
        };
        let simulation = Mutex::new(build().map_err(|e| to_python(py, &e))?);
        Ok(Self { simulation, sections, inputs })
    }

    /// Goes on to the last of `times` and returns (lengths, velocities, pressures, head_positions, measured_lengths, failure): a row at each
    /// time reached (measured_lengths: None where no effect acts on sensors), and None or the `SimulationError` that ended the run.
    #[allow(clippy::type_complexity)]
    fn advance<'py>(
        &self,
        times: &Bound<'py, PyAny>,
    ) -> PyResult<(Block<'py>, Block<'py>, Block<'py>, Block<'py>, Option<Block<'py>>, Option<Py<PyAny>>)> {
        let py = times.py();
        let times = any_vector(times, "times")?.as_slice()?.to_vec();
        let mut signal: Option<PyErr> = None;
        // The lock is never waited for: a thread that waited while attached would block the signal check of the other.
        let outcome = py.detach(|| {
            let mut simulation = self.simulation.try_lock().ok()?;
            let earliest = simulation.earliest();
            if times.first().is_some_and(|t| *t < earliest) || times.windows(2).any(|w| w[1] < w[0]) {
                return Some(Err(format!("times: they must ascend and not lie before {earliest} s")));
            }
            Some(Ok(simulation.advance(&times, &mut || {
                signal = Python::attach(|py| py.check_signals()).err();
                signal.is_some()
            })))
        });
        if let Some(error) = signal {
            return Err(error);
        }
        let (rows, result) = outcome.ok_or_else(|| busy(py))?.map_err(|text| input(py, text))?;
        let failure = result.err().map(|e| to_python(py, &e).into_value(py).into_any());
        let (m, n) = (rows.count, 3 * self.sections);
        let measured = rows.measured_lengths;
        let measured = (m > 0 && !measured.is_empty()).then(|| shaped(py, measured, [m, n]));
        Ok((
            shaped(py, rows.lengths, [m, n])?,
            shaped(py, rows.velocities, [m, n])?,
            shaped(py, rows.pressures, [m, self.inputs])?,
            shaped(py, rows.head_positions, [m, n])?,
            measured.transpose()?,
            failure,
        ))
    }

    /// Counts so far: (steps, rejected_steps, evaluations).
    #[getter]
    fn statistics(&self, py: Python<'_>) -> PyResult<(u64, u64, u64)> {
        let s = self.simulation.try_lock().map_err(|_| busy(py))?.statistics();
        Ok((s.steps, s.rejected_steps, s.evaluations))
    }
}

/// By the user's name.
pub(super) fn interpolation_by_name(py: Python<'_>, name: &str) -> PyResult<Interpolation> {
    Interpolation::by_name(name)
        .ok_or_else(|| input(py, format!("interpolation: {name:?}; \"linear\" or \"hold\" are allowed")))
}

/// Checked options.
pub(super) fn options(
    py: Python<'_>,
    method: &str,
    step: f64,
    (rtol, atol): (f64, f64),
    (min_step, max_step): (f64, f64),
    max_steps: Option<u64>,
) -> PyResult<Options> {
    let method = Method::by_name(method)
        .ok_or_else(|| input(py, format!("method: {method:?}; \"dopri5\", \"rk4\" or \"ros2\" are allowed")))?;
    for (name, value) in
        [("step", step), ("rtol", rtol), ("atol", atol), ("min_step", min_step), ("max_step", max_step)]
    {
        if value.is_nan() || value <= 0.0 {
            return Err(input(py, format!("{name}: {value}; a positive number is needed")));
        }
    }
    Ok(Options { method, step, rtol, atol, min_step, max_step, max_steps: max_steps.unwrap_or(u64::MAX) })
}

fn busy(py: Python<'_>) -> PyErr {
    input(py, "this simulation is being advanced by another thread; give each thread its own".to_owned())
}
