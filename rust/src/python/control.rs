//! The class `Controller`, and the functions of control.

use super::arm::PyArm;
use super::arrays::{absolute, any_matrix, finite, matrix, pressures, rows, shaped, small, vector};
use super::errors::{input, to_python};
use super::signals::{Shared, Signals};
use crate::control::riccati::regulator_gain;
use crate::control::task_space::{ResolvedMotion, Tip};
use crate::control::{Controller, ControllerParameters, Limits, Target, linearization, rest};
use crate::error::Error;
use crate::memory::reserved;
use crate::real::linear::Vec3;
use crate::run::watch::left_behind;
use nalgebra::DMatrix;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use std::sync::atomic::AtomicBool;

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// A controller of the core.
#[pyclass(name = "Controller", module = "bha._core", frozen)]
pub struct PyController {
    pub(super) controller: Shared<Controller>,
    pub(super) coordinates: usize,
    pub(super) inputs: usize,
}

#[pymethods]
impl PyController {
    #[new]
    fn new(arm: &Bound<'_, PyArm>, parameters_json: &str) -> PyResult<Self> {
        let py = arm.py();
        let parameters: ControllerParameters =
            serde_json::from_str(parameters_json).map_err(|e| input(py, format!("controller: {e}")))?;
        let arm = arm.get().arm.clone();
        let (coordinates, inputs) = (arm.coordinates(), arm.body.inputs);
        let controller = py.detach(|| Controller::new(arm, parameters)).map_err(|e| to_python(py, &e))?;
        Ok(Self { controller: Shared::new("controller", controller), coordinates, inputs })
    }

    /// Begins anew.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.controller.turn(py)?.reset();
        Ok(())
    }

    /// One period: commanded pressures (inputs,) for measured lengths and pressures and a target (3, 3n) of q, q', q''.
    fn step<'py>(
        &self,
        lengths: &Bound<'py, PyAny>,
        pressures: &Bound<'py, PyAny>,
        target: &Bound<'py, PyAny>,
    ) -> PyResult<Vector<'py>> {
        let (py, m) = (lengths.py(), self.coordinates);
        let q = vector(lengths, "lengths", m)?;
        let p = absolute(py, "pressures", vector(pressures, "pressures", self.inputs)?)?;
        let rows = matrix(target, "target", (3, m))?;
        let target = Target { q: &rows[..m], qd: &rows[m..2 * m], qdd: &rows[2 * m..] };
        let mut out = vec![0.0; self.inputs];
        let mut controller = self.controller.turn(py)?;
        controller.step(&q, &p, target, &mut out).map_err(|e| to_python(py, &e))?;
        Ok(small(py, &out))
    }

    /// Which inputs are at a limit (inputs,): -1 lowest, 1 highest, 0 neither.
    #[getter]
    fn at_limit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i8>>> {
        let controller = self.controller.turn(py)?;
        Ok(PyArray1::from_slice(py, controller.at_limit()))
    }

    /// The observer's lengths, rates and unexplained accelerations (3, 3n).
    #[getter]
    fn estimate<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let controller = self.controller.turn(py)?;
        let o = controller.observer();
        shaped(py, [o.lengths(), o.rates(), o.disturbance()].concat(), [3, self.coordinates])
    }

    /// Evaluations of the model a period with which the Kalman filter predicts; 0: one exponential step.
    #[getter]
    fn observer_substeps(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.controller.turn(py)?.observer().substeps())
    }

    /// The Kalman filter's gain (9n, 3n): corrections of lengths, rates and unexplained accelerations by innovations; zero
    /// before the first step and without a model.
    #[getter]
    fn observer_gain<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let controller = self.controller.turn(py)?;
        let m = self.coordinates;
        shaped(py, controller.observer().gain().to_vec(), [3 * m, m])
    }
}

fn limits(
    inputs: usize,
    low: &Bound<'_, PyAny>,
    high: &Bound<'_, PyAny>,
    preferred: &Bound<'_, PyAny>,
) -> PyResult<Limits> {
    Ok(Limits {
        low: vector(low, "low", inputs)?,
        high: vector(high, "high", inputs)?,
        preferred: vector(preferred, "preferred", inputs)?,
    })
}

/// A rest of an arm.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct Rest {
    /// Pressures (inputs,), Pa absolute.
    pressures: Py<PyArray1<f64>>,
    /// Lengths (3n,), m.
    lengths: Py<PyArray1<f64>>,
}

/// The rest under pressures within limits that is nearest to lengths `q`.
#[pyfunction]
pub fn rest_near(
    arm: &Bound<'_, PyArm>,
    q: &Bound<'_, PyAny>,
    low: &Bound<'_, PyAny>,
    high: &Bound<'_, PyAny>,
    preferred: &Bound<'_, PyAny>,
) -> PyResult<Rest> {
    let (py, arm) = (q.py(), &arm.get().arm);
    let q = vector(q, "q", arm.coordinates())?;
    let limits = limits(arm.body.inputs, low, high, preferred)?;
    let mut signals = Signals::new();
    let found = py.detach(|| rest::rest_near(arm, &q, &limits, &mut || signals.stop()));
    signals.result()?;
    let (p, q) = found.map_err(|e| to_python(py, &e))?;
    Ok(Rest { pressures: small(py, &p).unbind(), lengths: small(py, &q).unbind() })
}

/// Lengths (k, 3n) for tip positions (k, 3) and, if given, directions (k, 3), one after the other from `start` (3n,) on.
#[pyfunction]
#[pyo3(signature = (arm, positions, directions, start, low, high, offset = None))]
pub fn resolved_motion<'py>(
    arm: &Bound<'py, PyArm>,
    positions: &Bound<'py, PyAny>,
    directions: Option<&Bound<'py, PyAny>>,
    start: &Bound<'py, PyAny>,
    low: &Bound<'py, PyAny>,
    high: &Bound<'py, PyAny>,
    offset: Option<&Bound<'py, PyAny>>,
) -> PyResult<Matrix<'py>> {
    let (py, arm) = (positions.py(), arm.get().arm.clone());
    let m = arm.coordinates();
    let positions = rows(positions, "positions", 3)?;
    let count = positions.len() / 3;
    let directions = directions.map(|d| matrix(d, "directions", (count, 3))).transpose()?;
    let (low, high) = (vector(low, "low", m)?, vector(high, "high", m)?);
    let mut q = vector(start, "start", m)?;
    let offset = offset.map_or(Ok(vec![0.0; 3]), |o| vector(o, "offset", 3))?;
    let mut solver = ResolvedMotion::new(&arm, Vec3([offset[0], offset[1], offset[2]]), &low, &high);
    let mut out = reserved("lengths", &[count, m]).map_err(|e| to_python(py, &e))?;
    let at = |x: &[f64], k: usize| Vec3([x[3 * k], x[3 * k + 1], x[3 * k + 2]]);
    let mut signals = Signals::new();
    let mut work = || -> Result<(), Error> {
        for k in 0..count {
            if signals.stop() {
                return Err(Error::Interrupted);
            }
            let direction = match directions.as_ref().map(|d| at(d, k)) {
                None => None,
                Some(d) => {
                    let size = d.dot(d).sqrt();
                    if size < 1e-12 {
                        return Err(Error::Input(format!("directions: row {k} is zero; a direction is needed")));
                    }
                    Some(d * (1.0 / size))
                }
            };
            let tip = Tip { position: at(&positions, k), direction };
            solver.solve(&arm, &tip, &mut q).map_err(|e| match e {
                Error::Convergence(text) => Error::Convergence(format!("row {k}: {text}")),
                other => other,
            })?;
            out.extend_from_slice(&q);
        }
        Ok(())
    };
    let result = py.detach(&mut work);
    signals.result()?;
    result.map_err(|e| to_python(py, &e))?;
    shaped(py, finite(py, "lengths", out)?, [count, m])
}

/// A (6n, 6n) and B (6n, inputs) of x' = A x + B p around a state; with a period, of x_{k+1} = A x_k + B p_k.
#[pyfunction]
#[pyo3(signature = (arm, q, qd, p, period = None))]
pub fn linearize<'py>(
    arm: &Bound<'py, PyArm>,
    q: &Bound<'py, PyAny>,
    qd: &Bound<'py, PyAny>,
    p: &Bound<'py, PyAny>,
    period: Option<f64>,
) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
    let (py, arm) = (q.py(), &arm.get().arm);
    let m = arm.coordinates();
    let (q, qd, p) = (vector(q, "q", m)?, vector(qd, "qd", m)?, pressures(p, "p", arm.body.inputs)?);
    if let Some(h) = period.filter(|h| !(h.is_finite() && *h > 0.0)) {
        return Err(input(py, format!("period: {h}; a positive number of seconds is needed")));
    }
    let (a, b) = py.detach(|| {
        let linear = linearization::linearize(arm, &q, &qd, &p);
        match period {
            None => (linear.state, linear.input),
            Some(h) => linear.discretized(h),
        }
    });
    Ok((out(py, "A", &a)?, out(py, "B", &b)?))
}

/// K (inputs, states) of u = -K x for x_{k+1} = A x_k + B u_k, cost sum x^T Q x + u^T R u.
#[pyfunction]
pub fn linear_quadratic_gain<'py>(
    a: &Bound<'py, PyAny>,
    b: &Bound<'py, PyAny>,
    q: &Bound<'py, PyAny>,
    r: &Bound<'py, PyAny>,
) -> PyResult<Matrix<'py>> {
    let py = a.py();
    let (a, states) = any_matrix(a, "a")?;
    let (b, rows) = any_matrix(b, "b")?;
    let inputs = b.len() / rows.max(1);
    if a.len() != states * states || rows != states || inputs == 0 {
        let text = "a and b: shapes (states, states) and (states, inputs) with at least one of each are needed";
        return Err(input(py, format!("{text}, found {} numbers in {states} rows and {} in {rows}", a.len(), b.len())));
    }
    let (q, r) = (matrix(q, "q", (states, states))?, matrix(r, "r", (inputs, inputs))?);
    let square = |values: &[f64], rows| DMatrix::from_row_slice(rows, values.len() / rows, values);
    let (a, b, q, r) = (square(&a, states), square(&b, states), square(&q, states), square(&r, inputs));
    let mut signals = Signals::new();
    let work = move |stop: &AtomicBool| regulator_gain(&a, &b, &q, &r, stop);
    let gain = py.detach(|| left_behind(work, &mut || signals.stop()));
    signals.result()?;
    let gain = gain.unwrap_or(Err(Error::Interrupted)).map_err(|e| to_python(py, &e))?;
    out(py, "gain", &gain)
}

fn out<'py>(py: Python<'py>, name: &str, matrix: &DMatrix<f64>) -> PyResult<Matrix<'py>> {
    let values = finite(py, name, matrix.transpose().as_slice().to_vec())?;
    shaped(py, values, [matrix.nrows(), matrix.ncols()])
}
