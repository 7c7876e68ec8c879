//! The classes behind `Arm.forward_dynamics_derivatives` and `bha.sensitivities`.

use super::arm::PyArm;
use super::arrays::{any_vector, finite, force_rows, matrix, pressure_rows, pressures, shaped, small, vector};
use super::batch::instruction_set_by_name;
use super::errors::{input, to_python};
use super::signals::Signals;
use super::simulation::{interpolation_by_name, options};
use crate::arm::structure::tangent;
use crate::dynamics::derivatives::{self, Point};
use crate::memory::reserved;
use crate::plant::input::Input;
use crate::real::linear::Vec3;
use crate::run::sensitivity::{Direction, Trajectory};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;
type Cube<'py> = Bound<'py, PyArray3<f64>>;

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

    /// (q'', derivatives): one row of 3n a direction, by q, q', p and the arm's parameters.
    #[pyo3(signature = (q, qd, p, f_ext = None))]
    fn __call__<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        p: &Bound<'py, PyAny>,
        f_ext: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<(Vector<'py>, Matrix<'py>)> {
        let (py, n) = (q.py(), 3 * self.sections);
        let (q, qd) = (vector(q, "q", n)?, vector(qd, "qd", n)?);
        let p = pressures(p, "p", self.inputs)?;
        let f = f_ext.map(|f| matrix(f, "f_ext", (self.sections, 3))).transpose()?;
        let f: Option<Vec<_>> = f.map(|f| f.chunks_exact(3).map(|c| Vec3([c[0], c[1], c[2]])).collect());
        let at = Point { q: &q, qd: &qd, p: &p, f_ext: f.as_deref() };
        let directions = 2 * n + self.inputs + self.tangents;
        let (mut qdd, mut out) = (vec![0.0; n], vec![0.0; directions * n]);
        self.inner.lock().unwrap_or_else(std::sync::PoisonError::into_inner).run(at, &mut qdd, &mut out);
        let (qdd, out) = (finite(py, "acceleration", qdd)?, finite(py, "derivatives of the acceleration", out)?);
        Ok((small(py, &qdd), shaped(py, out, [directions, n])?))
    }
}

/// (states, derivatives): of shape (rows, 6n) and (directions, rows, 6n); see `bha.sensitivities`.
#[pyfunction]
#[pyo3(signature = (arm, times, pressures, forces, output_times, start, state, differences, parameter_of, directions, *, interpolation = "linear", method = "auto", step = 1e-3, rtol = 1e-6, atol = 1e-8, max_steps = None))]
#[allow(clippy::too_many_arguments)]
pub fn sensitivities<'py>(
    arm: &Bound<'py, PyArm>,
    times: &Bound<'py, PyAny>,
    pressures: &Bound<'py, PyAny>,
    forces: Option<&Bound<'py, PyAny>>,
    output_times: &Bound<'py, PyAny>,
    start: f64,
    state: &Bound<'py, PyAny>,
    differences: Vec<Difference<'py>>,
    parameter_of: Vec<Option<usize>>,
    directions: &Bound<'py, PyAny>,
    interpolation: &str,
    method: &str,
    step: f64,
    rtol: f64,
    atol: f64,
    max_steps: Option<i64>,
) -> PyResult<(Matrix<'py>, Cube<'py>)> {
    let py = arm.py();
    let arm = arm.get().arm.clone();
    let (columns, inputs) = (arm.coordinates(), arm.body.inputs);
    let size = 2 * columns;
    let options = options(py, method, step, (rtol, atol), (1e-10, f64::INFINITY), max_steps)?;
    let interpolation = interpolation_by_name(py, interpolation)?;
    let tangents = tangents(py, &differences)?;
    let times = any_vector(times, "times")?;
    let pressures = pressure_rows(pressures, "pressures", inputs)?;
    let forces = force_rows(forces, "forces", columns)?;
    let drive = Input::new(times, (pressures, inputs), forces, interpolation).map_err(|e| to_python(py, &e))?;
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
        let (arm, input) = (&*arm, &Arc::new(drive));
        let trajectory = Trajectory { arm, input, options, start, state, times: output_times };
        trajectory.differentiate(&directions, &mut || signals.stop())
    });
    signals.result()?;
    let (values, out) = result.map_err(|e| to_python(py, &e))?;
    let rows = output_times.len();
    Ok((shaped(py, values, [rows, size])?, shaped(py, out, [directions.len(), rows, size])?))
}
