//! The class `Simulation`: a run that can be advanced piece by piece.

use super::arm::PyArm;
use super::arrays::{any_vector, force_rows, pressure_rows, shaped, vector};
use super::errors::{failure, input, to_python};
use super::signals::Signals;
use crate::error::Error;
use crate::integrate::{Method, Options};
use crate::memory::reserved;
use crate::plant::input::{Input, Interpolation};
use crate::run::simulation::Simulation;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex};

/// A simulation under way.
#[pyclass(name = "Simulation", module = "bha._core", frozen)]
pub struct PySimulation {
    simulation: Mutex<Simulation>,
    sections: usize,
    inputs: usize,
}

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (arm, times, pressures, forces = None, *, interpolation = "linear", method = "auto", step = 1e-3, rtol = 1e-6, atol = 1e-8, min_step = 1e-10, max_step = f64::INFINITY, max_steps = None, start = None, q = None, qd = None))]
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
        max_steps: Option<i64>,
        start: Option<f64>,
        q: Option<&Bound<'_, PyAny>>,
        qd: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = arm.py();
        let arm = arm.get().arm.clone();
        let (sections, inputs) = (arm.body.sections.len(), arm.body.inputs);
        let interpolation = interpolation_by_name(py, interpolation)?;
        let options = options(py, method, step, (rtol, atol), (min_step, max_step), max_steps)?;
        let times = any_vector(times, "times")?;
        let pressures = pressure_rows(pressures, "pressures", inputs)?;
        let forces = force_rows(forces, "forces", 3 * sections)?;
        let q = q.map(|q| vector(q, "q", 3 * sections)).transpose()?;
        let qd = qd.map(|q| vector(q, "qd", 3 * sections)).transpose()?;
        let build = || {
            let input = Input::new(times, (pressures, inputs), forces, interpolation)?;
            let start = start.unwrap_or(input.origin());
            if !start.is_finite() {
                return Err(Error::Input(format!("start: {start}; a finite time is needed")));
            }
            Simulation::new(arm, Arc::new(input), options, start, q.as_deref(), qd.as_deref())
        };
        let simulation = Mutex::new(py.detach(build).map_err(|e| to_python(py, &e))?);
        Ok(Self { simulation, sections, inputs })
    }

    /// Goes on to the last of `times` and returns the rows by the names of the attributes of `Trajectory`, a row at each time
    /// reached (measured ones only where an effect acts on them), and None or the `SimulationError` that ended the run.
    fn advance<'py>(&self, times: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyDict>, Option<Py<PyAny>>)> {
        let py = times.py();
        let times = any_vector(times, "times")?;
        let columns = 3 * (3 * self.sections) + self.inputs;
        reserved("rows of the simulation", &[times.len(), columns]).map_err(|e| to_python(py, &e))?;
        let mut signals = Signals::new();
        // The lock is never waited for: a thread that waited while attached would block the signal check of the other.
        let outcome = py.detach(|| {
            let mut simulation = self.simulation.try_lock().ok()?;
            if times.first().is_some_and(|t| simulation.is_past(*t)) || times.windows(2).any(|w| w[1] < w[0]) {
                let earliest = simulation.earliest();
                return Some(Err(format!("times: they must ascend and not lie before {earliest} s")));
            }
            Some(Ok(simulation.advance(&times, &mut || signals.stop())))
        });
        signals.result()?;
        let (rows, result) = outcome.ok_or_else(|| busy(py))?.map_err(|text| input(py, text))?;
        let failure = result.err().map(|e| failure(py, &e)).transpose()?;
        let (m, n) = (rows.count, self.sections);
        let out = PyDict::new(py);
        for (name, values, columns) in [
            ("lengths", rows.lengths, 3 * n),
            ("velocities", rows.velocities, 3 * n),
            ("pressures", rows.pressures, self.inputs),
        ] {
            out.set_item(name, shaped(py, values, [m, columns])?)?;
        }
        for (name, values, columns) in
            [("head_positions", rows.head_positions, 3), ("head_orientations", rows.head_orientations, 4)]
        {
            out.set_item(name, shaped(py, values, [m, n, columns])?)?;
        }
        if !rows.measured_lengths.is_empty() {
            out.set_item("measured_lengths", shaped(py, rows.measured_lengths, [m, 3 * n])?)?;
        }
        for (name, values, columns) in [
            ("measured_head_positions", rows.measured_head_positions, 3),
            ("measured_head_orientations", rows.measured_head_orientations, 4),
        ] {
            if !values.is_empty() {
                out.set_item(name, shaped(py, values, [m, n, columns])?)?;
            }
        }
        Ok((out, failure))
    }

    /// The name of the method in use.
    #[getter]
    fn method(&self, py: Python<'_>) -> PyResult<&'static str> {
        Ok(self.simulation.try_lock().map_err(|_| busy(py))?.method().name())
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
    max_steps: Option<i64>,
) -> PyResult<Options> {
    let method = Method::by_name(method).ok_or_else(|| {
        let names: Vec<_> = Method::ALL.iter().map(|m| format!("{:?}", m.name())).collect();
        input(py, format!("method: {method:?}; {} are allowed", names.join(", ")))
    })?;
    for (name, value) in
        [("step", step), ("rtol", rtol), ("atol", atol), ("min_step", min_step), ("max_step", max_step)]
    {
        if value.is_nan() || value <= 0.0 {
            return Err(input(py, format!("{name}: {value}; a positive number is needed")));
        }
    }
    for (name, value) in [("step", step), ("rtol", rtol), ("atol", atol), ("min_step", min_step)] {
        if value.is_infinite() {
            return Err(input(py, format!("{name}: {value}; a finite number is needed")));
        }
    }
    let max_steps = match max_steps {
        Some(count) if count < 1 => {
            return Err(input(py, format!("max_steps: {count}; at least 1, or None for no limit, is needed")));
        }
        given => given.map_or(u64::MAX, i64::unsigned_abs),
    };
    Ok(Options { method, step, rtol, atol, min_step, max_step, max_steps })
}

/// Raises the `InputError` of options that are not allowed.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn check_options(
    py: Python<'_>,
    method: &str,
    step: f64,
    rtol: f64,
    atol: f64,
    min_step: f64,
    max_step: f64,
    max_steps: Option<i64>,
    interpolation: Option<&str>,
) -> PyResult<()> {
    options(py, method, step, (rtol, atol), (min_step, max_step), max_steps)?;
    interpolation.map_or(Ok(()), |name| interpolation_by_name(py, name).map(drop))
}

fn busy(py: Python<'_>) -> PyErr {
    input(py, "this simulation is being advanced by another thread; give each thread its own".to_owned())
}
