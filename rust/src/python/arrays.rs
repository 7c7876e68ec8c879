//! Arrays in and out: copied while the interpreter is held, checked for shape and finiteness on the copy.
//!
//! Nothing reads NumPy's memory later than that: other threads may write to it as soon as the interpreter is released. Plain
//! arrays of floats are read here; all others go through `bha.arrays.floats`, which also says what is wrong with them.

use super::errors::input;
use numpy::{IntoPyArray, PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{IntoPyDict, PyTuple};

/// Extents of an array; `None`: any.
type Shape<'a> = &'a [Option<usize>];

fn fits(found: &[usize], shape: Shape<'_>) -> bool {
    found.len() == shape.len() && found.iter().zip(shape).all(|(f, s)| s.is_none_or(|s| s == *f))
}

/// Numbers, row by row.
struct Found {
    values: Vec<f64>,
    dimensions: usize,
    rows: usize,
}

/// The numbers of a plain (no subclass), contiguous, aligned array of floats in one of the shapes, if it is such a one.
fn plain(value: &Bound<'_, PyAny>, shapes: &[Shape<'_>]) -> Option<Found> {
    if !value.is_exact_instance_of::<PyUntypedArray>() {
        return None;
    }
    let array = value.cast::<PyArrayDyn<f64>>().ok()?;
    if !array.is_c_contiguous() || !shapes.iter().any(|shape| fits(array.shape(), shape)) {
        return None;
    }
    let values = array.try_readonly().ok()?.as_slice().ok()?.to_vec();
    Some(Found { values, dimensions: array.ndim(), rows: array.shape().first().copied().unwrap_or(1) })
}

/// Finite numbers of an array in one of the shapes.
fn array(value: &Bound<'_, PyAny>, name: &str, shapes: &[Shape<'_>]) -> PyResult<Found> {
    numbers(value, name, shapes, true)
}

/// Numbers of an array in one of the shapes, `finite` or not.
fn numbers(value: &Bound<'_, PyAny>, name: &str, shapes: &[Shape<'_>], finite: bool) -> PyResult<Found> {
    match plain(value, shapes).filter(|found| good(found, finite)) {
        Some(found) => Ok(found),
        None => through_floats(value, name, shapes, finite),
    }
}

/// Whether the numbers are finite, where they must be.
fn good(found: &Found, finite: bool) -> bool {
    !finite || found.values.iter().all(|x| x.is_finite())
}

/// The same of an array of another kind, by `bha.arrays.floats`.
#[cold]
fn through_floats(value: &Bound<'_, PyAny>, name: &str, shapes: &[Shape<'_>], finite: bool) -> PyResult<Found> {
    static FLOATS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = value.py();
    let mut arguments = vec![value.clone(), name.into_pyobject(py)?.into_any()];
    for shape in shapes {
        arguments.push(PyTuple::new(py, *shape)?.into_any());
    }
    let options = [("finite", finite)].into_py_dict(py)?;
    let found = FLOATS.import(py, "bha.arrays", "floats")?.call(PyTuple::new(py, arguments)?, Some(&options))?;
    let found = plain(&found, shapes).filter(|found| good(found, finite));
    found.ok_or_else(|| input(py, format!("{name}: it was changed while it was read")))
}

/// A vector of the given length.
pub fn vector(value: &Bound<'_, PyAny>, name: &str, length: usize) -> PyResult<Vec<f64>> {
    Ok(array(value, name, &[&[Some(length)]])?.values)
}

/// A vector of any length.
pub fn any_vector(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    Ok(array(value, name, &[&[None]])?.values)
}

/// The same where the numbers need not be finite.
pub fn any_numbers(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    Ok(numbers(value, name, &[&[None]], false)?.values)
}

/// A matrix with any number of rows.
pub fn rows(value: &Bound<'_, PyAny>, name: &str, columns: usize) -> PyResult<Vec<f64>> {
    Ok(array(value, name, &[&[None, Some(columns)]])?.values)
}

/// A matrix.
pub fn matrix(value: &Bound<'_, PyAny>, name: &str, (rows, columns): (usize, usize)) -> PyResult<Vec<f64>> {
    Ok(array(value, name, &[&[Some(rows), Some(columns)]])?.values)
}

/// The same where the numbers need not be finite.
pub fn table(value: &Bound<'_, PyAny>, name: &str, (rows, columns): (usize, usize)) -> PyResult<Vec<f64>> {
    Ok(numbers(value, name, &[&[Some(rows), Some(columns)]], false)?.values)
}

/// A matrix of any size, with the number of its rows.
pub fn any_matrix(value: &Bound<'_, PyAny>, name: &str) -> PyResult<(Vec<f64>, usize)> {
    let found = array(value, name, &[&[None, None]])?;
    Ok((found.values, found.rows))
}

/// A vector of the given length, or a matrix of such rows; the number of rows of a matrix.
pub fn vector_or_rows(value: &Bound<'_, PyAny>, name: &str, length: usize) -> PyResult<(Vec<f64>, Option<usize>)> {
    let found = array(value, name, &[&[Some(length)], &[None, Some(length)]])?;
    Ok((found.values, (found.dimensions == 2).then_some(found.rows)))
}

/// A whole number within limits.
pub fn whole(value: &Bound<'_, PyAny>, name: &str, (low, high): (usize, usize)) -> PyResult<usize> {
    let (py, allowed) = (value.py(), format!("whole numbers from {low} to {high} are allowed"));
    match value.extract::<usize>() {
        Ok(n) if (low..=high).contains(&n) => Ok(n),
        // Also what is no number of this size, or no number at all.
        _ => Err(input(py, format!("{name}: {}; {allowed}", shortened(&value.repr()?.to_string_lossy())))),
    }
}

/// The beginning of a text that may be long.
fn shortened(text: &str) -> String {
    let mut start: String = text.chars().take(60).collect();
    if start.len() < text.len() {
        start.push_str("...");
    }
    start
}

/// Pressures, Pa absolute: none is negative.
pub fn absolute(py: Python<'_>, name: &str, values: Vec<f64>) -> PyResult<Vec<f64>> {
    match values.iter().position(|p| *p < 0.0) {
        None => Ok(values),
        Some(k) => Err(input(
            py,
            format!(
                "{name}: element {k} is {} Pa; pressures are absolute and not negative. Is this gauge pressure? Then add \
                 the ambient pressure",
                values[k]
            ),
        )),
    }
}

/// A vector of absolute pressures.
pub fn pressures(value: &Bound<'_, PyAny>, name: &str, length: usize) -> PyResult<Vec<f64>> {
    absolute(value.py(), name, vector(value, name, length)?)
}

/// A small vector out, copied.
pub fn small<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, values)
}

/// An array out, moved.
pub fn shaped<'py, const D: usize>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: [usize; D],
) -> PyResult<Bound<'py, PyArray<f64, numpy::ndarray::Dim<[usize; D]>>>>
where
    numpy::ndarray::Dim<[usize; D]>: numpy::ndarray::Dimension,
    [usize; D]: numpy::ndarray::IntoDimension<Dim = numpy::ndarray::Dim<[usize; D]>>,
{
    values.into_pyarray(py).reshape(shape)
}

/// What the model answers, `what`, if it is finite.
pub fn finite<V: AsRef<[f64]>>(py: Python<'_>, what: &str, values: V) -> PyResult<V> {
    if values.as_ref().iter().all(|x| x.is_finite()) {
        return Ok(values);
    }
    Err(input(
        py,
        format!(
            "{what}: not finite at these arguments; they are too large for the model, or a formula of the arm is not finite there"
        ),
    ))
}
