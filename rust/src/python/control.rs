//! The classes `Stepper` and `Controller`, and the functions of control.

use super::arm::PyArm;
use super::arrays::{any_vector, matrix, rows, shaped, small, vector};
use super::errors::{input, to_python};
use crate::closed_loop::{self as core_loop, Exchange, Reference, Sensors, Stepper};
use crate::control::riccati::regulator_gain;
use crate::control::task_space::{ResolvedMotion, Tip};
use crate::control::{Controller, ControllerParameters, Limits, Target, linearization};
use crate::error::Error;
use crate::fleet::{Fleet, Start, Stepping};
use crate::linear::Vec3;
use nalgebra::DMatrix;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard};

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

fn busy(py: Python<'_>, what: &str) -> PyErr {
    input(py, format!("this {what} is used by another thread; give each thread its own"))
}

/// A plant that is stepped from outside.
#[pyclass(name = "Stepper", module = "bha._core", frozen, subclass)]
pub struct PyStepper {
    stepper: Mutex<Stepper>,
    coordinates: usize,
    inputs: usize,
}

impl PyStepper {
    fn lock(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, Stepper>> {
        self.stepper.try_lock().map_err(|_| busy(py, "stepper"))
    }
}

#[pymethods]
impl PyStepper {
    #[new]
    #[pyo3(signature = (arm, step = 1e-3))]
    fn new(arm: &Bound<'_, PyArm>, step: f64) -> PyResult<Self> {
        let arm_core = arm.get().arm.clone();
        let (coordinates, inputs) = (arm_core.coordinates(), arm_core.inputs);
        let stepper = Stepper::new(arm_core, step).map_err(|e| to_python(arm.py(), &e))?;
        Ok(Self { stepper: Mutex::new(stepper), coordinates, inputs })
    }

    /// Time 0, pressures `p` (inputs,) in all chambers, lengths `q` (3n,), at rest under `p` if None, and rates `qd`.
    #[pyo3(signature = (p, q = None, qd = None))]
    fn reset<'py>(
        &self,
        p: &Bound<'py, PyAny>,
        q: Option<&Bound<'py, PyAny>>,
        qd: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vector<'py>> {
        let py = p.py();
        let p = vector(p, "p", self.inputs)?;
        let q = q.map(|q| vector(q, "q", self.coordinates)).transpose()?;
        let qd = qd.map(|q| vector(q, "qd", self.coordinates)).transpose()?;
        let q = q.as_ref().map(|q| q.as_slice()).transpose()?;
        let qd = qd.as_ref().map(|q| q.as_slice()).transpose()?;
        let mut stepper = self.lock(py)?;
        stepper.reset(q, qd, p.as_slice()?).map_err(|e| to_python(py, &e))?;
        Ok(observation(py, &stepper))
    }

    /// Holds the commanded pressures `p` (inputs,), Pa absolute, for `dt` s; returns lengths, then acting pressures.
    fn step<'py>(&self, p: &Bound<'py, PyAny>, dt: f64) -> PyResult<Vector<'py>> {
        let py = p.py();
        if !(dt.is_finite() && dt > 0.0) {
            return Err(input(py, format!("dt: {dt}; a positive number of seconds is needed")));
        }
        let p = vector(p, "p", self.inputs)?;
        let mut stepper = self.lock(py)?;
        stepper.step(p.as_slice()?, dt).map_err(|e| to_python(py, &e))?;
        Ok(observation(py, &stepper))
    }

    /// Time since the reset, s.
    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.lock(py)?.time())
    }
    /// Lengths (3n,), m.
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.lock(py)?.lengths()))
    }
    /// Rates (3n,), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.lock(py)?.rates()))
    }
    /// Acting pressures (inputs,), Pa absolute.
    #[getter]
    fn pressures<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.lock(py)?.pressures()))
    }
}

fn observation<'py>(py: Python<'py>, stepper: &Stepper) -> Vector<'py> {
    let (q, p) = (stepper.lengths(), stepper.pressures());
    let out = PyArray1::zeros(py, q.len() + p.len(), false);
    if let Ok(mut view) = out.try_readwrite()
        && let Ok(slice) = view.as_slice_mut()
    {
        slice[..q.len()].copy_from_slice(q);
        slice[q.len()..].copy_from_slice(p);
    }
    out
}

/// Many plants of one arm, stepped together.
#[pyclass(name = "Fleet", module = "bha._core", frozen)]
pub struct PyFleet {
    fleet: Mutex<Fleet>,
}

#[pymethods]
impl PyFleet {
    /// `count` plants of `arm`, all at rest at lengths `q` (3n,) under pressures `p` (inputs,).
    #[new]
    #[pyo3(signature = (arm, count, q, p, step = 5e-3, threads = 0, method = "rk4"))]
    fn new(
        arm: &Bound<'_, PyArm>,
        count: usize,
        q: &Bound<'_, PyAny>,
        p: &Bound<'_, PyAny>,
        step: f64,
        threads: usize,
        method: &str,
    ) -> PyResult<Self> {
        let py = arm.py();
        let stepping = Stepping::by_name(method)
            .ok_or_else(|| input(py, format!("method: {method:?}; \"rk4\" and \"symplectic_euler\" are allowed")))?;
        let arm = arm.get().arm.clone();
        let (q, p) = (vector(q, "q", arm.coordinates())?, vector(p, "p", arm.inputs)?);
        let start = Start { q: q.as_slice()?, p: p.as_slice()? };
        let fleet = Fleet::new(&arm, count, start, (stepping, step), threads).map_err(|e| to_python(py, &e))?;
        Ok(Self { fleet: Mutex::new(fleet) })
    }

    /// Puts plants `indices` (k,) at rest at lengths `q` (k, 3n) under pressures `p` (k, inputs); returns the rows of all.
    fn reset<'py>(&self, indices: Vec<usize>, q: &Bound<'py, PyAny>, p: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let py = q.py();
        let mut fleet = self.fleet.try_lock().map_err(|_| busy(py, "fleet"))?;
        let (m, inputs, count) = (fleet.coordinates(), fleet.inputs(), fleet.count());
        let (q, p) = (matrix(q, "q", (indices.len(), m))?, matrix(p, "p", (indices.len(), inputs))?);
        let rows = q.as_slice()?.chunks_exact(m).zip(p.as_slice()?.chunks_exact(inputs));
        for (&k, (q, p)) in indices.iter().zip(rows) {
            if k >= count {
                return Err(input(py, format!("indices: {k}; 0 to {} are allowed", count - 1)));
            }
            fleet.reset(k, Start { q, p });
        }
        let mut out = vec![0.0; count * fleet.width()];
        fleet.read(&mut out);
        shaped(py, out, [count, fleet.width()])
    }

    /// Holds commands `p` (count, inputs), Pa absolute, for `dt` s; returns rows of (lengths, rates, chamber pressures, tip) and
    /// which plants diverged (they are back where they began last).
    fn step<'py>(&self, p: &Bound<'py, PyAny>, dt: f64) -> PyResult<(Matrix<'py>, Bound<'py, PyArray1<bool>>)> {
        let py = p.py();
        if !(dt.is_finite() && dt > 0.0) {
            return Err(input(py, format!("dt: {dt}; a positive number of seconds is needed")));
        }
        let (count, width, inputs) = {
            let fleet = self.fleet.try_lock().map_err(|_| busy(py, "fleet"))?;
            (fleet.count(), fleet.width(), fleet.inputs())
        };
        let p = matrix(p, "p", (count, inputs))?;
        let p = p.as_slice()?;
        let (mut failed, mut out) = (vec![false; count], vec![0.0; count * width]);
        let done =
            py.detach(|| self.fleet.try_lock().map(|mut fleet| fleet.step(p, dt, &mut failed, &mut out)).is_ok());
        if !done {
            return Err(busy(py, "fleet"));
        }
        Ok((shaped(py, out, [count, width])?, failed.into_pyarray(py)))
    }
}

/// A controller of the core.
#[pyclass(name = "Controller", module = "bha._core", frozen)]
pub struct PyController {
    controller: Mutex<Controller>,
    coordinates: usize,
    inputs: usize,
}

#[pymethods]
impl PyController {
    #[new]
    fn new(arm: &Bound<'_, PyArm>, parameters_json: &str) -> PyResult<Self> {
        let py = arm.py();
        let parameters: ControllerParameters =
            serde_json::from_str(parameters_json).map_err(|e| input(py, format!("controller: {e}")))?;
        let arm = arm.get().arm.clone();
        let (coordinates, inputs) = (arm.coordinates(), arm.inputs);
        let controller = Controller::new(arm, parameters).map_err(|e| to_python(py, &e))?;
        Ok(Self { controller: Mutex::new(controller), coordinates, inputs })
    }

    /// Begins anew.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.controller.try_lock().map_err(|_| busy(py, "controller"))?.reset();
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
        let (q, p) = (vector(lengths, "lengths", m)?, vector(pressures, "pressures", self.inputs)?);
        let target = matrix(target, "target", (3, m))?;
        let rows = target.as_slice()?;
        let target = Target { q: &rows[..m], qd: &rows[m..2 * m], qdd: &rows[2 * m..] };
        let mut out = vec![0.0; self.inputs];
        let mut controller = self.controller.try_lock().map_err(|_| busy(py, "controller"))?;
        controller.step(q.as_slice()?, p.as_slice()?, target, &mut out).map_err(|e| to_python(py, &e))?;
        Ok(small(py, &out))
    }

    /// Which inputs are at a limit (inputs,): -1 lowest, 1 highest, 0 neither.
    #[getter]
    fn at_limit<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i8>>> {
        let controller = self.controller.try_lock().map_err(|_| busy(py, "controller"))?;
        Ok(PyArray1::from_slice(py, controller.at_limit()))
    }

    /// The observer's lengths, rates and unexplained accelerations (3, 3n).
    #[getter]
    fn estimate<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let controller = self.controller.try_lock().map_err(|_| busy(py, "controller"))?;
        let o = controller.observer();
        shaped(py, [o.lengths(), o.rates(), o.disturbance()].concat(), [3, self.coordinates])
    }

    /// The Kalman filter's gain (9n, 3n): corrections of lengths, rates and unexplained accelerations by innovations; zero
    /// before the first step and without a model.
    #[getter]
    fn observer_gain<'py>(&self, py: Python<'py>) -> PyResult<Matrix<'py>> {
        let controller = self.controller.try_lock().map_err(|_| busy(py, "controller"))?;
        let m = self.coordinates;
        shaped(py, controller.observer().gain().to_vec(), [3 * m, m])
    }
}

/// Runs a closed loop from the stepper's present state over the rows of `reference` (k, 9n), one a period.
///
/// `controller` is a `Controller` of the core or a callable (t, y) -> p with y = measured lengths, then pressures. Returns
/// (lengths, velocities, pressures, commands, estimated velocities, at_limit, head positions, failure).
#[pyfunction]
#[pyo3(signature = (stepper, controller, reference, period, *, length_noise = 0.0, pressure_noise = 0.0, seed = 0, decimation = 1))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn closed_loop<'py>(
    stepper: &Bound<'py, PyStepper>,
    controller: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    period: f64,
    length_noise: f64,
    pressure_noise: f64,
    seed: u64,
    decimation: usize,
) -> PyResult<(
    Matrix<'py>,
    Matrix<'py>,
    Matrix<'py>,
    Matrix<'py>,
    Matrix<'py>,
    Bound<'py, PyArray2<i8>>,
    Matrix<'py>,
    Option<Py<PyAny>>,
)> {
    let py = stepper.py();
    let stepper = stepper.get();
    let (m, inputs) = (stepper.coordinates, stepper.inputs);
    for (name, value) in [("length_noise", length_noise), ("pressure_noise", pressure_noise)] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(input(py, format!("{name}: {value}; a number not below zero is needed")));
        }
    }
    if !(period.is_finite() && period > 0.0) {
        return Err(input(py, format!("period: {period}; a positive number of seconds is needed")));
    }
    let reference = rows(reference, "reference", 3 * m)?.as_slice()?.to_vec();
    let reference = Reference::new(reference, m).map_err(|e| to_python(py, &e))?;
    let plan = (period, reference.len(), decimation);
    let sensors = Sensors { length_noise, pressure_noise, seed };
    let mut raised: Option<PyErr> = None;
    let (out, result) = if let Ok(core) = controller.cast::<PyController>() {
        let core = core.get();
        if (core.coordinates, core.inputs) != (m, inputs) {
            return Err(input(
                py,
                format!(
                    "controller: made for {} lengths and {} inputs, the plant has {m} and {inputs}",
                    core.coordinates, core.inputs
                ),
            ));
        }
        let run = || {
            let mut plant = stepper.stepper.try_lock().ok()?;
            let mut controller = core.controller.try_lock().ok()?;
            let mut control = |x: Exchange<'_>| {
                let (lengths, pressures) = x.measured.split_at(m);
                controller.step(lengths, pressures, x.target, x.command)?;
                x.estimated_velocities.copy_from_slice(controller.observer().rates());
                x.at_limit.copy_from_slice(controller.at_limit());
                Ok(())
            };
            Some(core_loop::run(&mut plant, sensors, &reference, plan, &mut control, &mut || {
                raised = Python::attach(|py| py.check_signals()).err();
                raised.is_some()
            }))
        };
        py.detach(run).ok_or_else(|| busy(py, "stepper or controller"))?
    } else {
        let mut plant = stepper.lock(py)?;
        let mut control = |x: Exchange<'_>| {
            let answer = (|| {
                let p = controller.call1((x.time, PyArray1::from_slice(py, x.measured)))?;
                let p = vector(&p, "controller(t, y)", inputs)?;
                x.command.copy_from_slice(p.as_slice()?);
                Ok(())
            })();
            answer.map_err(|error: PyErr| {
                raised = Some(error);
                Error::Interrupted
            })
        };
        core_loop::run(&mut plant, sensors, &reference, plan, &mut control, &mut || false)
    };
    if let Some(error) = raised {
        return Err(error);
    }
    let failure = result.err().map(|e| to_python(py, &e).into_value(py).into_any());
    let count = out.count;
    Ok((
        shaped(py, out.lengths, [count, m])?,
        shaped(py, out.velocities, [count, m])?,
        shaped(py, out.pressures, [count, inputs])?,
        shaped(py, out.commands, [count, inputs])?,
        shaped(py, out.estimated_velocities, [count, m])?,
        out.at_limit.into_pyarray(py).reshape([count, inputs])?,
        shaped(py, out.head_positions, [count, m])?,
        failure,
    ))
}

fn limits(
    inputs: usize,
    low: &Bound<'_, PyAny>,
    high: &Bound<'_, PyAny>,
    preferred: &Bound<'_, PyAny>,
) -> PyResult<Limits> {
    Ok(Limits {
        low: vector(low, "low", inputs)?.as_slice()?.to_vec(),
        high: vector(high, "high", inputs)?.as_slice()?.to_vec(),
        preferred: vector(preferred, "preferred", inputs)?.as_slice()?.to_vec(),
    })
}

/// Pressures (inputs,) under which the arm rests nearest to lengths `q`, and the lengths (3n,) at which it then rests.
#[pyfunction]
pub fn rest_near<'py>(
    arm: &Bound<'py, PyArm>,
    q: &Bound<'py, PyAny>,
    low: &Bound<'py, PyAny>,
    high: &Bound<'py, PyAny>,
    preferred: &Bound<'py, PyAny>,
) -> PyResult<(Vector<'py>, Vector<'py>)> {
    let (py, arm) = (q.py(), &arm.get().arm);
    let q = vector(q, "q", arm.coordinates())?;
    let limits = limits(arm.inputs, low, high, preferred)?;
    let (p, rest) = core_loop::rest_near(arm, q.as_slice()?, &limits).map_err(|e| to_python(py, &e))?;
    Ok((small(py, &p), small(py, &rest)))
}

/// Lengths (k, 3n) for tip positions (k, 3) and, if given, directions (k, 3), one after the other from `start` (3n,) on.
#[pyfunction]
#[pyo3(signature = (arm, positions, directions, start, low, high, offset = [0.0; 3]))]
pub fn resolved_motion<'py>(
    arm: &Bound<'py, PyArm>,
    positions: &Bound<'py, PyAny>,
    directions: Option<&Bound<'py, PyAny>>,
    start: &Bound<'py, PyAny>,
    low: &Bound<'py, PyAny>,
    high: &Bound<'py, PyAny>,
    offset: [f64; 3],
) -> PyResult<Matrix<'py>> {
    let (py, arm) = (positions.py(), arm.get().arm.clone());
    let m = arm.coordinates();
    let positions = rows(positions, "positions", 3)?;
    let count = positions.shape()[0];
    let directions = directions.map(|d| matrix(d, "directions", (count, 3))).transpose()?;
    let (low, high) = (vector(low, "low", m)?, vector(high, "high", m)?);
    let mut q = vector(start, "start", m)?.as_slice()?.to_vec();
    let mut solver = ResolvedMotion::new(&arm, Vec3(offset), low.as_slice()?, high.as_slice()?);
    let positions = positions.as_slice()?;
    let directions = directions.as_ref().map(|d| d.as_slice()).transpose()?;
    let mut out = Vec::with_capacity(count * m);
    let at = |x: &[f64], k: usize| Vec3([x[3 * k], x[3 * k + 1], x[3 * k + 2]]);
    for k in 0..count {
        if k % 256 == 0 {
            py.check_signals()?;
        }
        let direction = match directions.map(|d| at(d, k)) {
            None => None,
            Some(d) => {
                let size = d.dot(d).sqrt();
                if size < 1e-12 {
                    return Err(input(py, format!("directions: row {k} is zero; a direction is needed")));
                }
                Some(d * (1.0 / size))
            }
        };
        let tip = Tip { position: at(positions, k), direction };
        solver.solve(&arm, &tip, &mut q).map_err(|e| match e {
            Error::Convergence(text) => to_python(py, &Error::Convergence(format!("row {k}: {text}"))),
            other => to_python(py, &other),
        })?;
        out.extend_from_slice(&q);
    }
    shaped(py, out, [count, m])
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
    let (q, qd, p) = (vector(q, "q", m)?, vector(qd, "qd", m)?, vector(p, "p", arm.inputs)?);
    let linear = linearization::linearize(arm, q.as_slice()?, qd.as_slice()?, p.as_slice()?);
    let (a, b) = match period {
        None => (linear.state, linear.input),
        Some(h) if h.is_finite() && h > 0.0 => linear.discretized(h),
        Some(h) => return Err(input(py, format!("period: {h}; a positive number of seconds is needed"))),
    };
    Ok((out(py, &a)?, out(py, &b)?))
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
    let states: usize = a.len()?;
    let inputs = any_vector(&b.get_item(0)?, "b[0]")?.len();
    let read = |x: &Bound<'py, PyAny>, name: &str, r: usize, c: usize| -> PyResult<DMatrix<f64>> {
        Ok(DMatrix::from_row_slice(r, c, matrix(x, name, (r, c))?.as_slice()?))
    };
    let (a, b) = (read(a, "a", states, states)?, read(b, "b", states, inputs)?);
    let (q, r) = (read(q, "q", states, states)?, read(r, "r", inputs, inputs)?);
    let gain = regulator_gain(&a, &b, &q, &r).map_err(|e| to_python(py, &e))?;
    out(py, &gain)
}

fn out<'py>(py: Python<'py>, matrix: &DMatrix<f64>) -> PyResult<Matrix<'py>> {
    shaped(py, matrix.transpose().as_slice().to_vec(), [matrix.nrows(), matrix.ncols()])
}
