//! The class `Simulation`: a run that can be advanced piece by piece.

use super::arm::PyArm;
use super::arrays::{any_vector, shaped, vector};
use super::errors::{failure, input, to_python};
use super::input::{PyInput, interpolation_by_name};
use super::signals::Signals;
use crate::error::Error;
use crate::integrate::{Method, Options};
use crate::memory::reserved;
use crate::run::simulation::Simulation;
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use std::sync::Mutex;

/// A simulation under way.
#[pyclass(name = "Simulation", module = "bha._core", frozen)]
pub struct PySimulation {
    simulation: Mutex<Simulation>,
    sections: usize,
    inputs: usize,
}

/// Rows of a simulation, one at each time reached.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct SimulationRows {
    /// Lengths (m, 3n), m.
    lengths: Py<PyArray2<f64>>,
    /// Rates (m, 3n), m/s.
    velocities: Py<PyArray2<f64>>,
    /// Pressures in the chambers (m, inputs), Pa absolute.
    pressures: Py<PyArray2<f64>>,
    /// Origins of the heads (m, n, 3), m.
    head_positions: Py<PyArray3<f64>>,
    /// Their orientations, unit quaternions (m, n, 4).
    head_orientations: Py<PyArray3<f64>>,
    /// As their sensors have them, where an effect acts on them.
    measured_lengths: Option<Py<PyArray2<f64>>>,
    /// Likewise.
    measured_head_positions: Option<Py<PyArray3<f64>>>,
    /// Likewise.
    measured_head_orientations: Option<Py<PyArray3<f64>>>,
    /// The `SimulationError` that ended the run, if one did.
    failure: Option<Py<PyAny>>,
}

/// What a run cost.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct StepCounts {
    /// Accepted steps.
    steps: u64,
    /// Rejected steps.
    rejected_steps: u64,
    /// Evaluations of the equations of motion.
    evaluations: u64,
}

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (arm, drive, *, method = "auto", step = 1e-3, rtol = 1e-6, atol = 1e-8, min_step = 1e-10, max_step = f64::INFINITY, max_steps = None, start = None, q = None, qd = None))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        arm: &Bound<'_, PyArm>,
        drive: &Bound<'_, PyInput>,
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
        let options = options(py, method, step, (rtol, atol), (min_step, max_step), max_steps)?;
        let drive = drive.get().of(py, &arm)?;
        let q = q.map(|q| vector(q, "q", 3 * sections)).transpose()?;
        let qd = qd.map(|q| vector(q, "qd", 3 * sections)).transpose()?;
        let build = || {
            let start = start.unwrap_or(drive.origin());
            if !start.is_finite() {
                return Err(Error::Input(format!("start: {start}; a finite time is needed")));
            }
            Simulation::new(arm, drive, options, start, q.as_deref(), qd.as_deref())
        };
        let simulation = Mutex::new(py.detach(build).map_err(|e| to_python(py, &e))?);
        Ok(Self { simulation, sections, inputs })
    }

    /// Goes on to the last of `times` and returns the rows, with what ended the run if it did.
    fn advance(&self, times: &Bound<'_, PyAny>) -> PyResult<SimulationRows> {
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
        let flat = |values, columns| shaped(py, values, [m, columns]).map(Bound::unbind);
        let heads = |values, columns| shaped(py, values, [m, n, columns]).map(Bound::unbind);
        let some = |values: Vec<f64>| (!values.is_empty()).then_some(values);
        Ok(SimulationRows {
            lengths: flat(rows.lengths, 3 * n)?,
            velocities: flat(rows.velocities, 3 * n)?,
            pressures: flat(rows.pressures, self.inputs)?,
            head_positions: heads(rows.head_positions, 3)?,
            head_orientations: heads(rows.head_orientations, 4)?,
            measured_lengths: some(rows.measured_lengths).map(|x| flat(x, 3 * n)).transpose()?,
            measured_head_positions: some(rows.measured_head_positions).map(|x| heads(x, 3)).transpose()?,
            measured_head_orientations: some(rows.measured_head_orientations).map(|x| heads(x, 4)).transpose()?,
            failure,
        })
    }

    /// The name of the method in use.
    #[getter]
    fn method(&self, py: Python<'_>) -> PyResult<&'static str> {
        Ok(self.simulation.try_lock().map_err(|_| busy(py))?.method().name())
    }

    /// Counts so far.
    #[getter]
    fn statistics(&self, py: Python<'_>) -> PyResult<StepCounts> {
        let s = self.simulation.try_lock().map_err(|_| busy(py))?.statistics();
        Ok(StepCounts { steps: s.steps, rejected_steps: s.rejected_steps, evaluations: s.evaluations })
    }
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
