//! The function `simulate_batch`.

use super::arm::PyArm;
use super::arrays::{any_vector, matrix, shaped, vector};
use super::errors::{failure, input, to_python};
use super::input::PyInput;
use super::simulation::options;
use crate::error::Error;
use crate::real::lanes::InstructionSet;
use crate::run::batch::{Batch, Channels, Member};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;

/// Rows of a batch, those of member k at index k; NaN where a member has none.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct BatchRows {
    /// Lengths (members, rows, 3n), m.
    lengths: Py<PyArray3<f64>>,
    /// Rates (members, rows, 3n), m/s, if wanted.
    velocities: Option<Py<PyArray3<f64>>>,
    /// Origins of the heads (members, rows, 3n), m, if wanted.
    head_positions: Option<Py<PyArray3<f64>>>,
    /// Their orientations, unit quaternions (members, rows, 4n), if wanted.
    head_orientations: Option<Py<PyArray3<f64>>>,
    /// What ended each member early, or None.
    failures: Vec<Option<Py<PyAny>>>,
    /// Steps, rejected steps and evaluations (members, 3).
    statistics: Py<PyArray2<u64>>,
}

/// The `k`th of `arms`, `inputs` and `times` as `members[k]` = (arm, input, times) say, from `start[k]`, `state[k]` and
/// `moved[k]` on (where what each bellows remembers stands, [`crate::plant::Plant::moved`]); see `bha.simulate_batch`.
#[pyfunction]
#[pyo3(signature = (arms, inputs, times, members, start, state = None, moved = None, *, method = "auto", step = 1e-3, rtol = 1e-6, atol = 1e-8, min_step = 1e-10, max_step = f64::INFINITY, max_steps = None, velocities = true, head_positions = false, head_orientations = false, measured = false, shared_steps = false, threads = 0, instruction_set = None, progress = None))]
#[allow(clippy::too_many_arguments)]
pub fn simulate_batch(
    py: Python<'_>,
    arms: Vec<Bound<'_, PyArm>>,
    inputs: Vec<Bound<'_, PyInput>>,
    times: Vec<Bound<'_, PyAny>>,
    members: Vec<(usize, usize, usize)>,
    start: &Bound<'_, PyAny>,
    state: Option<&Bound<'_, PyAny>>,
    moved: Option<&Bound<'_, PyAny>>,
    method: &str,
    step: f64,
    rtol: f64,
    atol: f64,
    min_step: f64,
    max_step: f64,
    max_steps: Option<i64>,
    velocities: bool,
    head_positions: bool,
    head_orientations: bool,
    measured: bool,
    shared_steps: bool,
    threads: usize,
    instruction_set: Option<&str>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<BatchRows> {
    let options = options(py, method, step, (rtol, atol), (min_step, max_step), max_steps)?;
    let arms: Vec<_> = arms.iter().map(|a| a.get().arm.clone()).collect();
    let Some(first) = arms.first() else { return Err(input(py, "arms: none; at least one is needed".to_owned())) };
    let (columns, bellows) = (first.coordinates(), first.bellows());
    let inputs = inputs.iter().map(|input| input.get().of(py, first)).collect::<PyResult<Vec<_>>>()?;
    let times =
        times.iter().enumerate().map(|(k, t)| any_vector(t, &format!("times[{k}]"))).collect::<PyResult<Vec<_>>>()?;
    let start = vector(start, "start", members.len())?;
    let state = state.map(|x| matrix(x, "x0", (members.len(), 2 * columns))).transpose()?;
    let moved = moved.map(|x| matrix(x, "moved", (members.len(), bellows))).transpose()?;
    let build = |(k, &(arm, input, set)): (usize, &(usize, usize, usize))| {
        let times = times.get(set).ok_or_else(|| Error::Input(format!("member {k} wants times {set}; there are none")));
        let state = state.as_ref().map(|x| &x[2 * columns * k..2 * columns * (k + 1)]);
        let moved = moved.as_ref().map(|x| &x[bellows * k..bellows * (k + 1)]);
        Ok(Member { arm, input, start: start[k], state, moved, times: times? })
    };
    let members = members.iter().enumerate().map(build).collect::<Result<Vec<_>, Error>>();
    let members = members.map_err(|e| to_python(py, &e))?;

    let batch = Batch {
        arms: &arms,
        inputs: &inputs,
        members: &members,
        options,
        channels: Channels { velocities, head_positions, orientations: head_orientations, measured },
        shared_steps,
        instruction_set: instruction_set_by_name(py, instruction_set)?,
    };
    let mut signal: Option<PyErr> = None;
    let progress = progress.map(|p| p.clone().unbind());
    let count = members.len();
    let outcome = py.detach(|| {
        batch.run(threads, &mut |done| {
            let ask = |py: Python<'_>| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |p| p.bind(py).call1((done as f64 / count as f64,)).map(drop))
            };
            if signal.is_none() {
                signal = Python::attach(ask).err();
            }
            signal.is_some()
        })
    });
    if let Some(error) = signal {
        return Err(error);
    }
    let out = outcome.map_err(|e| to_python(py, &e))?;
    let shape = [count, out.rows, columns];
    let block = |values, shape| shaped(py, values, shape).map(Bound::unbind);
    let optional = |wanted: bool, values, shape| wanted.then(|| block(values, shape)).transpose();
    let failed = |e: &Option<Error>| e.as_ref().map(|e| failure(py, e)).transpose();
    let counts = out.statistics.iter().flat_map(|s| [s.steps, s.rejected_steps, s.evaluations]).collect::<Vec<_>>();
    Ok(BatchRows {
        lengths: block(out.lengths, shape)?,
        velocities: optional(velocities, out.velocities, shape)?,
        head_positions: optional(head_positions, out.head_positions, shape)?,
        head_orientations: optional(head_orientations, out.head_orientations, [count, out.rows, columns / 3 * 4])?,
        failures: out.failures.iter().map(failed).collect::<PyResult<_>>()?,
        statistics: counts.into_pyarray(py).reshape([count, 3])?.unbind(),
    })
}

/// By the user's name; the widest one that this processor has if none.
pub(super) fn instruction_set_by_name(py: Python<'_>, name: Option<&str>) -> PyResult<InstructionSet> {
    let Some(name) = name else { return Ok(InstructionSet::best()) };
    let available: Vec<_> = InstructionSet::ALL.into_iter().filter(|s| s.is_available()).map(|s| s.name()).collect();
    InstructionSet::by_name(name)
        .filter(|s| s.is_available())
        .ok_or_else(|| input(py, format!("instruction_set: {name:?}; this processor has {}", available.join(", "))))
}

/// Names of the instruction sets that this processor has, from the narrowest on.
#[pyfunction]
pub fn instruction_sets() -> Vec<&'static str> {
    InstructionSet::ALL.into_iter().filter(|s| s.is_available()).map(|s| s.name()).collect()
}
