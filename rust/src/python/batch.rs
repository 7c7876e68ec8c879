//! The function `simulate_batch`.

use super::arm::PyArm;
use super::arrays::{any_vector, force_rows, matrix, pressure_rows, shaped, vector};
use super::errors::{failure, input, to_python};
use super::simulation::{interpolation_by_name, options};
use crate::error::Error;
use crate::plant::input::{Input, Interpolation};
use crate::real::lanes::InstructionSet;
use crate::run::batch::{Batch, Channels, Member};
use numpy::{PyArray2, PyArray3};
use pyo3::prelude::*;
use std::sync::Arc;

type Blocks<'py> = Bound<'py, PyArray3<f64>>;
/// Sample times, pressures, forces.
type Samples<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>);

/// The `k`th of `arms`, `inputs` and `times` as `members[k]` = (arm, input, times) say, from `start[k]` and `state[k]` on.
///
/// Returns (lengths, velocities or None, head positions or None, head orientations or None, failures, statistics); see
/// `bha.simulate_batch`.
#[pyfunction]
#[pyo3(signature = (arms, inputs, times, members, start, state = None, *, interpolation = None, method = "auto", step = 1e-3, rtol = 1e-6, atol = 1e-8, min_step = 1e-10, max_step = f64::INFINITY, max_steps = None, velocities = true, head_positions = false, head_orientations = false, measured = false, shared_steps = false, threads = 0, instruction_set = None, progress = None))]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub fn simulate_batch<'py>(
    py: Python<'py>,
    arms: Vec<Bound<'py, PyArm>>,
    inputs: Vec<Samples<'py>>,
    times: Vec<Bound<'py, PyAny>>,
    members: Vec<(usize, usize, usize)>,
    start: &Bound<'py, PyAny>,
    state: Option<&Bound<'py, PyAny>>,
    interpolation: Option<Vec<String>>,
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
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<(
    Blocks<'py>,
    Option<Blocks<'py>>,
    Option<Blocks<'py>>,
    Option<Blocks<'py>>,
    Vec<Option<Py<PyAny>>>,
    Bound<'py, PyArray2<u64>>,
)> {
    // Straight lines between the samples of all inputs unless each says what holds there.
    let interpolation = match interpolation {
        Some(names) if names.len() != inputs.len() => {
            let text = format!("interpolation: {} names; {} inputs need one each", names.len(), inputs.len());
            return Err(input(py, text));
        }
        Some(names) => names.iter().map(|name| interpolation_by_name(py, name)).collect::<PyResult<_>>()?,
        None => vec![Interpolation::Linear; inputs.len()],
    };
    let options = options(py, method, step, (rtol, atol), (min_step, max_step), max_steps)?;
    let arms: Vec<_> = arms.iter().map(|a| a.get().arm.clone()).collect();
    let Some(first) = arms.first() else { return Err(input(py, "arms: none; at least one is needed".to_owned())) };
    let (columns, pressure_count) = (first.coordinates(), first.body.inputs);
    let read = |(k, (time, pressures, forces)): (usize, &Samples<'py>)| -> PyResult<Arc<Input>> {
        let time = any_vector(time, &format!("inputs[{k}].time"))?;
        let pressures = pressure_rows(pressures, &format!("inputs[{k}].pressures"), pressure_count)?;
        let forces = force_rows(forces.as_ref(), &format!("inputs[{k}].forces"), columns)?;
        let built = Input::new(time, (pressures, pressure_count), forces, interpolation[k]);
        Ok(Arc::new(built.map_err(|e| to_python(py, &e))?))
    };
    let inputs = inputs.iter().enumerate().map(read).collect::<PyResult<Vec<_>>>()?;
    let times =
        times.iter().enumerate().map(|(k, t)| any_vector(t, &format!("times[{k}]"))).collect::<PyResult<Vec<_>>>()?;
    let start = vector(start, "start", members.len())?;
    let state = state.map(|x| matrix(x, "x0", (members.len(), 2 * columns))).transpose()?;
    let build = |(k, &(arm, input, set)): (usize, &(usize, usize, usize))| {
        let times = times.get(set).ok_or_else(|| Error::Input(format!("member {k} wants times {set}; there are none")));
        let state = state.as_ref().map(|x| &x[2 * columns * k..2 * columns * (k + 1)]);
        Ok(Member { arm, input, start: start[k], state, times: times? })
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
    let optional = |wanted: bool, values, shape| if wanted { shaped(py, values, shape).map(Some) } else { Ok(None) };
    let failed = |e: &Option<Error>| e.as_ref().map(|e| failure(py, e)).transpose();
    let counts = out.statistics.iter().flat_map(|s| [s.steps, s.rejected_steps, s.evaluations]).collect::<Vec<_>>();
    Ok((
        shaped(py, out.lengths, shape)?,
        optional(velocities, out.velocities, shape)?,
        optional(head_positions, out.head_positions, shape)?,
        optional(head_orientations, out.head_orientations, [count, out.rows, columns / 3 * 4])?,
        out.failures.iter().map(failed).collect::<PyResult<_>>()?,
        numpy::PyArrayMethods::reshape(&numpy::IntoPyArray::into_pyarray(counts, py), [count, 3])?,
    ))
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
