//! Plants that are stepped from outside, one or many, and how to step them.

use super::arm::PyArm;
use super::arrays::{absolute, any_vector, finite, matrix, pressures, rows, shaped, small, vector};
use super::errors::{input, to_python};
use super::signals::{Shared, Signals};
use crate::run::fleet::{Fleet, Start};
use crate::run::stepper::Stepper;
use crate::run::stepping::{self, Plan, Stepping, Wish};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

type Vector<'py> = Bound<'py, PyArray1<f64>>;
type Matrix<'py> = Bound<'py, PyArray2<f64>>;

/// Steps times coordinates up to which a call is so short (a millisecond or so) that it keeps the interpreter: getting it back
/// can take longer where other threads want it too.
const SHORT: f64 = 5000.0;

/// A plant that is stepped from outside.
#[pyclass(name = "Stepper", module = "bha._core", frozen, subclass)]
pub struct PyStepper {
    pub(super) stepper: Shared<Stepper>,
    pub(super) coordinates: usize,
    pub(super) inputs: usize,
    step: f64,
}

#[pymethods]
impl PyStepper {
    #[new]
    #[pyo3(signature = (arm, step = 1e-3, method = "rk4"))]
    fn new(arm: &Bound<'_, PyArm>, step: f64, method: &str) -> PyResult<Self> {
        let arm_core = arm.get().arm.clone();
        let (coordinates, inputs) = (arm_core.coordinates(), arm_core.body.inputs);
        let py = arm.py();
        let plan = Plan { stepping: stepping_by_name(py, method)?, step };
        let stepper = py.detach(|| Stepper::new(arm_core, plan)).map_err(|e| to_python(py, &e))?;
        Ok(Self { stepper: Shared::new("stepper", stepper), coordinates, inputs, step })
    }

    /// Everything that decides what comes next, as a row of numbers.
    #[getter]
    fn _state<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(self.stepper.turn(py)?.state().into_pyarray(py))
    }

    /// Goes on from what `_state` of the same arm was.
    fn _resume(&self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = state.py();
        let numbers = any_vector(state, "state")?;
        self.stepper.turn(py)?.set_state(&numbers).map_err(|e| to_python(py, &e))
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
        let p = pressures(p, "p", self.inputs)?;
        let q = q.map(|q| vector(q, "q", self.coordinates)).transpose()?;
        let qd = qd.map(|q| vector(q, "qd", self.coordinates)).transpose()?;
        let mut turn = self.stepper.turn(py)?;
        let (stepper, mut signals) = (&mut *turn, Signals::new());
        let result = py.detach(|| stepper.reset(q.as_deref(), qd.as_deref(), &p, &mut || signals.stop()));
        signals.result()?;
        result.map_err(|e| to_python(py, &e))?;
        Ok(observation(py, stepper))
    }

    /// Holds the commanded pressures `p` (inputs,), Pa absolute, for `dt` s; returns measured lengths, then acting pressures.
    fn step<'py>(&self, p: &Bound<'py, PyAny>, dt: f64) -> PyResult<Vector<'py>> {
        let py = p.py();
        if !(dt.is_finite() && dt > 0.0) {
            return Err(input(py, format!("dt: {dt}; a positive number of seconds is needed")));
        }
        let p = pressures(p, "p", self.inputs)?;
        let mut turn = self.stepper.turn(py)?;
        let (stepper, mut signals) = (&mut *turn, Signals::new());
        let mut work = || stepper.step(&p, dt, &mut || signals.stop());
        let short = dt / self.step * self.coordinates as f64 <= SHORT;
        let result = if short { work() } else { py.detach(work) };
        signals.result()?;
        result.map_err(|e| to_python(py, &e))?;
        Ok(observation(py, stepper))
    }

    /// Time since the reset, s.
    #[getter]
    fn time(&self, py: Python<'_>) -> PyResult<f64> {
        Ok(self.stepper.turn(py)?.time())
    }
    /// True lengths (3n,), m.
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.stepper.turn(py)?.lengths()))
    }
    /// Lengths as their sensors have them (3n,), m.
    #[getter]
    fn measured_lengths<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.stepper.turn(py)?.measured_lengths()))
    }
    /// Rates (3n,), m/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.stepper.turn(py)?.rates()))
    }
    /// Acting pressures (inputs,), Pa absolute.
    #[getter]
    fn pressures<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(small(py, self.stepper.turn(py)?.pressures()))
    }
}

fn observation<'py>(py: Python<'py>, stepper: &Stepper) -> Vector<'py> {
    let (q, p) = (stepper.measured_lengths(), stepper.pressures());
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
#[pyclass(name = "Fleet", module = "bha._core", frozen, subclass)]
pub struct PyFleet {
    fleet: Shared<Fleet>,
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
        let plan = Plan { stepping: stepping_by_name(py, method)?, step };
        let arm = arm.get().arm.clone();
        let (q, p) = (vector(q, "q", arm.coordinates())?, pressures(p, "p", arm.body.inputs)?);
        let start = Start { q: &q, p: &p };
        let fleet = py.detach(|| Fleet::new(&arm, count, start, plan, threads));
        Ok(Self { fleet: Shared::new("fleet", fleet.map_err(|e| to_python(py, &e))?) })
    }

    /// Puts plants `indices` (k,) at rest at lengths `q` (k, 3n) under pressures `p` (k, inputs); returns the rows of all.
    fn reset<'py>(&self, indices: Vec<usize>, q: &Bound<'py, PyAny>, p: &Bound<'py, PyAny>) -> PyResult<Matrix<'py>> {
        let py = q.py();
        let mut fleet = self.fleet.turn(py)?;
        let (m, inputs, count) = (fleet.coordinates(), fleet.inputs(), fleet.count());
        let q = matrix(q, "q", (indices.len(), m))?;
        let p = absolute(py, "p", matrix(p, "p", (indices.len(), inputs))?)?;
        let rows = q.chunks_exact(m).zip(p.chunks_exact(inputs));
        for (&k, (q, p)) in indices.iter().zip(rows) {
            if k >= count {
                return Err(input(py, format!("indices: {k}; 0 to {} are allowed", count - 1)));
            }
            fleet.reset(k, Start { q, p });
        }
        let mut out = vec![0.0; count * fleet.width()];
        fleet.read(&mut out);
        shaped(py, finite(py, "states of the plants", out)?, [count, fleet.width()])
    }

    /// Everything that decides what comes next, as a row of numbers.
    #[getter]
    fn _state<'py>(&self, py: Python<'py>) -> PyResult<Vector<'py>> {
        Ok(self.fleet.turn(py)?.state().into_pyarray(py))
    }

    /// Goes on from what `_state` of as many plants of the same arm was.
    fn _resume(&self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let py = state.py();
        let numbers = any_vector(state, "state")?;
        self.fleet.turn(py)?.set_state(&numbers).map_err(|e| to_python(py, &e))
    }

    /// Holds commands `p` (count, inputs), Pa absolute, for `dt` s; returns rows of (measured lengths, rates, chamber pressures, tip) and
    /// which plants diverged (they are back where they began last).
    fn step<'py>(&self, p: &Bound<'py, PyAny>, dt: f64) -> PyResult<(Matrix<'py>, Bound<'py, PyArray1<bool>>)> {
        let py = p.py();
        if !(dt.is_finite() && dt > 0.0) {
            return Err(input(py, format!("dt: {dt}; a positive number of seconds is needed")));
        }
        let mut turn = self.fleet.turn(py)?;
        let (count, width, inputs) = (turn.count(), turn.width(), turn.inputs());
        let p = absolute(py, "p", matrix(p, "p", (count, inputs))?)?;
        let (mut failed, mut out) = (vec![false; count], vec![0.0; count * width]);
        let (fleet, mut signals) = (&mut *turn, Signals::new());
        let result = py.detach(|| fleet.step(&p, dt, &mut failed, &mut out, &mut || signals.stop()));
        signals.result()?;
        result.map_err(|e| to_python(py, &e))?;
        Ok((shaped(py, out, [count, width])?, failed.into_pyarray(py)))
    }
}

/// How to step, by the user's name.
fn stepping_by_name(py: Python<'_>, name: &str) -> PyResult<Stepping> {
    Stepping::by_name(name).ok_or_else(|| {
        input(
            py,
            format!("method: {name:?}; \"rk4\", \"ros2\" and, for environments, \"symplectic_euler\" are allowed"),
        )
    })
}

/// How an arm is stepped.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct StepPlan {
    /// Name of the method.
    method: &'static str,
    /// Its longest step, s.
    step: f64,
}

/// How to step `arm` around rest under each row of `pressures` (k, inputs), Pa absolute.
///
/// `method` None: the cheapest that is stable; `step` None: at most `usual` s.
#[pyfunction]
#[pyo3(signature = (arm, pressures, method, step, usual))]
pub fn plan_steps(
    arm: &Bound<'_, PyArm>,
    pressures: &Bound<'_, PyAny>,
    method: Option<&str>,
    step: Option<f64>,
    usual: f64,
) -> PyResult<StepPlan> {
    let py = arm.py();
    let arm = arm.get().arm.clone();
    let pressures = rows(pressures, "pressures", arm.body.inputs)?;
    let stepping = method.map(|name| stepping_by_name(py, name)).transpose()?;
    let mut signals = Signals::new();
    let plan = py.detach(|| stepping::plan(&arm, &pressures, Wish { stepping, step, usual }, &mut || signals.stop()));
    signals.result()?;
    plan.map(|plan| StepPlan { method: plan.stepping.name(), step: plan.step }).map_err(|e| to_python(py, &e))
}
