//! The function `innovations`.

use super::arrays::{any_matrix, any_vector, matrix, rows, shaped, vector};
use super::errors::input;
use crate::innovations::Rows;
use numpy::PyArray2;
use pyo3::prelude::*;

/// Innovations (rows, channels columns) of residuals, channel by channel, and the logarithm of the determinant of their
/// covariance; None where that is not positive. A row's kind says what it shows and which transition leads to the next.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "a linear system and its rows")]
pub fn innovations<'py>(
    transitions: &Bound<'py, PyAny>,
    added: &Bound<'py, PyAny>,
    kinds: Vec<usize>,
    kept: &Bound<'py, PyAny>,
    sizes: &Bound<'py, PyAny>,
    shown: &Bound<'py, PyAny>,
    white: &Bound<'py, PyAny>,
    read: Vec<bool>,
    covariance: &Bound<'py, PyAny>,
    values: &Bound<'py, PyAny>,
) -> PyResult<Option<(Bound<'py, PyArray2<f64>>, f64)>> {
    let py = values.py();
    let (white, sizes) = (any_vector(white, "white")?, any_vector(sizes, "sizes")?);
    let (channels, states, count) = (white.len(), sizes.len(), kinds.len());
    let transitions = rows(transitions, "transitions", states * states)?;
    let choices = transitions.len() / (states * states).max(1);
    let added = matrix(added, "added", (choices, states * states))?;
    let kept = matrix(kept, "kept", (count, states))?;
    let shown = matrix(shown, "shown", (choices, channels * states))?;
    let covariance = vector(covariance, "covariance", states * states)?;
    let (mut values, found) = any_matrix(values, "values")?;
    let wide = values.len() / found.max(1);
    if found != count || read.len() != count * channels || channels == 0 || wide % channels != 0 {
        return Err(input(
            py,
            format!("values: {found} rows of {wide}; {count} rows of {channels} channels are needed"),
        ));
    }
    if let Some(kind) = kinds.iter().find(|kind| **kind >= choices.max(1)) {
        return Err(input(py, format!("kinds: {kind}; there are {choices} transitions")));
    }
    let system = Rows {
        states,
        channels,
        transitions: &transitions,
        added: &added,
        kinds: &kinds,
        kept: &kept,
        sizes: &sizes,
        shown: &shown,
        white: &white,
        read: &read,
    };
    let total = py.detach(|| system.whiten(&covariance, wide / channels, &mut values));
    total.map(|total| Ok((shaped(py, values, [found, wide])?, total))).transpose()
}
