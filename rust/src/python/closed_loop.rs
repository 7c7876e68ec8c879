//! The function `closed_loop`.

use super::arrays::{pressures, rows, shaped, whole};
use super::control::PyController;
use super::errors::{failure, input, to_python};
use super::signals::Signals;
use super::stepping::PyStepper;
use crate::error::Error;
use crate::memory::reserved;
use crate::run::closed_loop::{self as core_loop, Exchange, Reference, Sensors};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;

/// Rows of a closed loop, one a recorded period, at the moment of measurement.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct LoopRows {
    /// Lengths (m, 3n), m.
    lengths: Py<PyArray2<f64>>,
    /// Rates (m, 3n), m/s.
    velocities: Py<PyArray2<f64>>,
    /// Pressures in the chambers (m, inputs), Pa absolute.
    pressures: Py<PyArray2<f64>>,
    /// Commanded pressures from then on (m, inputs), Pa absolute.
    commands: Py<PyArray2<f64>>,
    /// Estimated rates (m, 3n), m/s; NaN where the controller has none.
    estimated_velocities: Py<PyArray2<f64>>,
    /// -1, 0, 1 for each input: at its lowest, between, at its highest (m, inputs).
    at_limit: Py<PyArray2<i8>>,
    /// Origins of the heads (m, 3n), m.
    head_positions: Py<PyArray2<f64>>,
    /// The error that ended the loop, if one did.
    failure: Option<Py<PyAny>>,
}

/// Runs a closed loop from the stepper's present state over the rows of `reference` (k, 9n), one a period.
///
/// `controller` is a `Controller` of the core or a callable (t, y) -> p with y = measured lengths, then pressures.
#[pyfunction]
#[pyo3(signature = (stepper, controller, reference, period, *, length_noise = 0.0, pressure_noise = 0.0, seed = None, decimation = None))]
#[allow(clippy::too_many_arguments)]
pub fn closed_loop(
    stepper: &Bound<'_, PyStepper>,
    controller: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    period: f64,
    length_noise: f64,
    pressure_noise: f64,
    seed: Option<&Bound<'_, PyAny>>,
    decimation: Option<&Bound<'_, PyAny>>,
) -> PyResult<LoopRows> {
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
    let seed = seed.map_or(Ok(0), |k| whole(k, "seed", (0, usize::MAX)))? as u64;
    let decimation = decimation.map_or(Ok(1), |k| whole(k, "decimation", (1, usize::MAX)))?;
    let reference = rows(reference, "reference", 3 * m)?;
    let reference = Reference::new(reference, m).map_err(|e| to_python(py, &e))?;
    let plan = (period, reference.len(), decimation);
    let sensors = Sensors { length_noise, pressure_noise, seed };
    let numbers = [reference.len() / decimation.max(1) + 1, 4 * m + 2 * inputs];
    reserved("rows of the closed loop", &numbers).map_err(|e| to_python(py, &e))?;
    let mut turn = stepper.stepper.turn(py)?;
    let (plant, mut signals) = (&mut *turn, Signals::new());
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
        let mut turn = core.controller.turn(py)?;
        let controller = &mut *turn;
        let mut control = |x: Exchange<'_>| {
            let (lengths, pressures) = x.measured.split_at(m);
            controller.step(lengths, pressures, x.target, x.command)?;
            x.estimated_velocities.copy_from_slice(controller.observer().rates());
            x.at_limit.copy_from_slice(controller.at_limit());
            Ok(())
        };
        py.detach(|| core_loop::run(plant, sensors, &reference, plan, &mut control, &mut || signals.stop()))
    } else {
        let (callable, mut raised) = (controller.clone().unbind(), None);
        let mut control = |x: Exchange<'_>| {
            let answer = Python::attach(|py| {
                let p = callable.bind(py).call1((x.time, PyArray1::from_slice(py, x.measured)))?;
                x.command.copy_from_slice(&pressures(&p, "controller(t, y)", inputs)?);
                Ok(())
            });
            answer.map_err(|error: PyErr| {
                raised = Some(error);
                Error::Interrupted
            })
        };
        let done = py.detach(|| core_loop::run(plant, sensors, &reference, plan, &mut control, &mut || signals.stop()));
        if let Some(error) = raised {
            return Err(error);
        }
        done
    };
    signals.result()?;
    let failure = result.err().map(|e| failure(py, &e)).transpose()?;
    let count = out.count;
    let block = |values, columns| shaped(py, values, [count, columns]).map(Bound::unbind);
    Ok(LoopRows {
        lengths: block(out.lengths, m)?,
        velocities: block(out.velocities, m)?,
        pressures: block(out.pressures, inputs)?,
        commands: block(out.commands, inputs)?,
        estimated_velocities: block(out.estimated_velocities, m)?,
        at_limit: out.at_limit.into_pyarray(py).reshape([count, inputs])?.unbind(),
        head_positions: block(out.head_positions, m)?,
        failure,
    })
}
