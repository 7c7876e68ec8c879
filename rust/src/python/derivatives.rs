//! The classes behind `Arm.forward_dynamics_derivatives` and `bha.sensitivities`.

use super::arm::PyArm;
use super::arrays::{any_vector, finite, matrix, pressures, shaped, small, vector};
use super::batch::instruction_set_by_name;
use super::errors::{input, to_python};
use super::external::Outside;
use super::input::PyInput;
use super::signals::Signals;
use super::simulation::options;
use crate::arm::structure::tangent;
use crate::dynamics::derivatives::{self, Point};
use crate::memory::reserved;
use crate::run::sensitivity::{Direction, Trajectory};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use std::sync::Mutex;

/// Arms and weights whose sum is the derivative of the arm's numbers by one parameter.
type Difference<'py> = (Vec<Bound<'py, PyArm>>, Vec<f64>);

fn tangents(py: Python<'_>, differences: &[Difference<'_>]) -> PyResult<Vec<Vec<f64>>> {
    let one = |(arms, weights): &Difference<'_>| {
        let arms: Vec<_> = arms.iter().map(|a| a.get().arm.clone()).collect();
        let arms: Vec<_> = arms.iter().map(|a| &**a).collect();
        let different = || input(py, "the arms of a difference must differ in numbers alone".to_owned());
        tangent(&arms, weights).ok_or_else(different)
    };
    differences.iter().map(one).collect()
}

/// An acceleration and its derivatives.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct Differentiated {
    /// q'' (3n,), m/s^2.
    acceleration: Py<PyArray1<f64>>,
    /// One row of 3n a direction: by q, q', p and the arm's parameters.
    rows: Py<PyArray2<f64>>,
}

/// A trajectory and its derivatives.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct SensitivityRows {
    /// Lengths and rates (rows, 6n).
    states: Py<PyArray2<f64>>,
    /// Their derivatives (directions, rows, 6n).
    derivatives: Py<PyArray3<f64>>,
}

/// Takes derivatives of an arm's forward dynamics.
#[pyclass(module = "bha._core", frozen)]
pub struct Differentiator {
    inner: Mutex<Box<dyn derivatives::Differentiator>>,
    sections: usize,
    inputs: usize,
    tangents: usize,
}

#[pymethods]
impl Differentiator {
    #[new]
    #[pyo3(signature = (arm, differences = Vec::new(), instruction_set = None))]
    fn new(arm: &Bound<'_, PyArm>, differences: Vec<Difference<'_>>, instruction_set: Option<&str>) -> PyResult<Self> {
        let set = instruction_set_by_name(arm.py(), instruction_set)?;
        let tangents = tangents(arm.py(), &differences)?;
        let arm = &arm.get().arm;
        let inner = Mutex::new(derivatives::differentiator(arm, &tangents, set));
        Ok(Self { inner, sections: arm.body.sections.len(), inputs: arm.body.inputs, tangents: tangents.len() })
    }

    /// The acceleration and its derivatives at one state.
    #[pyo3(signature = (q, qd, p, f_ext = None, wrenches = None))]
    fn __call__<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        p: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Differentiated> {
        let (py, n) = (q.py(), 3 * self.sections);
        let (q, qd) = (vector(q, "q", n)?, vector(qd, "qd", n)?);
        let p = pressures(p, "p", self.inputs)?;
        let outside = Outside::read(f_ext, wrenches, self.sections)?;
        let at = Point { q: &q, qd: &qd, p: &p, f_ext: outside.get() };
        let directions = 2 * n + self.inputs + self.tangents;
        let (mut qdd, mut out) = (vec![0.0; n], vec![0.0; directions * n]);
        self.inner.lock().unwrap_or_else(std::sync::PoisonError::into_inner).run(at, &mut qdd, &mut out);
        let (qdd, out) = (finite(py, "acceleration", qdd)?, finite(py, "derivatives of the acceleration", out)?);
        let rows = shaped(py, out, [directions, n])?.unbind();
        Ok(Differentiated { acceleration: small(py, &qdd).unbind(), rows })
    }
}

/// A trajectory under `drive` and its derivatives along some directions; see `bha.sensitivities`.
#[pyfunction]
#[pyo3(signature = (arm, drive, output_times, start, state, differences, parameter_of, directions, *, method = "auto", step = 1e-3, rtol = 1e-6, atol = 1e-8, max_steps = None))]
#[allow(clippy::too_many_arguments)]
pub fn sensitivities<'py>(
    arm: &Bound<'py, PyArm>,
    drive: &Bound<'py, PyInput>,
    output_times: &Bound<'py, PyAny>,
    start: f64,
    state: &Bound<'py, PyAny>,
    differences: Vec<Difference<'py>>,
    parameter_of: Vec<Option<usize>>,
    directions: &Bound<'py, PyAny>,
    method: &str,
    step: f64,
    rtol: f64,
    atol: f64,
    max_steps: Option<i64>,
) -> PyResult<SensitivityRows> {
    let py = arm.py();
    let arm = arm.get().arm.clone();
    let size = 2 * arm.coordinates();
    let options = options(py, method, step, (rtol, atol), (1e-10, f64::INFINITY), max_steps)?;
    let tangents = tangents(py, &differences)?;
    let drive = drive.get().of(py, &arm)?;
    let output_times = any_vector(output_times, "times")?;
    let state = vector(state, "x0", size)?;
    let seeds = matrix(directions, "derivatives of x0", (parameter_of.len(), size))?;
    let nothing: &[f64] = &[];
    let directions: Vec<_> = seeds
        .chunks_exact(size)
        .zip(&parameter_of)
        .map(|(state, k)| Direction { tangent: k.and_then(|k| tangents.get(k)).map_or(nothing, Vec::as_slice), state })
        .collect();
    let (state, output_times) = (&state[..], &output_times[..]);
    let numbers = [directions.len() + 1, output_times.len(), size];
    reserved("rows of the sensitivities", &numbers).map_err(|e| to_python(py, &e))?;
    let mut signals = Signals::new();
    let result = py.detach(|| {
        let (arm, input) = (&*arm, &drive);
        let trajectory = Trajectory { arm, input, options, start, state, times: output_times };
        trajectory.differentiate(&directions, &mut || signals.stop())
    });
    signals.result()?;
    let (values, out) = result.map_err(|e| to_python(py, &e))?;
    let rows = output_times.len();
    Ok(SensitivityRows {
        states: shaped(py, values, [rows, size])?.unbind(),
        derivatives: shaped(py, out, [directions.len(), rows, size])?.unbind(),
    })
}
