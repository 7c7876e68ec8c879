//! Arrays in and out: checked for shape and finiteness, with an error that says what was expected and found.

use super::errors::input;
use numpy::{IntoPyArray, PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;

/// `value` as a contiguous float64 array of the given shape (`None`: any extent).
fn array<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    shape: &[Option<usize>],
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = value.py();
    let wanted = || {
        let parts: Vec<String> = shape.iter().map(|e| e.map_or("any".to_owned(), |e| e.to_string())).collect();
        format!("({}{})", parts.join(", "), if parts.len() == 1 { "," } else { "" })
    };
    let direct = value.cast::<PyArrayDyn<f64>>().ok().filter(|a| a.is_c_contiguous());
    let array = match direct {
        Some(a) => a.clone(),
        None => convert(value).map_err(|e| {
            input(py, format!("{name}: an array of floats of shape {} is needed; {}", wanted(), e.value(py)))
        })?,
    };
    let found = array.shape();
    if found.len() != shape.len() || found.iter().zip(shape).any(|(f, s)| s.is_some_and(|s| s != *f)) {
        return Err(input(py, format!("{name}: expected shape {}, found {found:?}", wanted())));
    }
    let view = array.readonly();
    let slice = view.as_slice()?;
    if let Some(k) = slice.iter().position(|x| !x.is_finite()) {
        return Err(input(py, format!("{name}: element {k} is {}; finite numbers are needed", slice[k])));
    }
    Ok(view)
}

/// Anything NumPy can turn into a contiguous float64 array without loss of kind (no complex, no text).
fn convert<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    static RESULT: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = value.py();
    let asarray = ASARRAY.import(py, "numpy", "asarray")?;
    let ascontiguous = RESULT.import(py, "numpy", "ascontiguousarray")?;
    let general = asarray.call1((value,))?;
    let kind: String = general.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["f", "i", "u"].contains(&kind.as_str()) {
        let found = general.getattr("dtype")?.str()?;
        return Err(pyo3::exceptions::PyTypeError::new_err(format!("found dtype {found}")));
    }
    Ok(ascontiguous.call1((general, "float64"))?.cast_into::<PyArrayDyn<f64>>()?)
}

/// A vector of the given length.
pub fn vector<'py>(value: &Bound<'py, PyAny>, name: &str, length: usize) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    array(value, name, &[Some(length)])
}

/// A vector of any length.
pub fn any_vector<'py>(value: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    array(value, name, &[None])
}

/// A matrix with any number of rows.
pub fn rows<'py>(value: &Bound<'py, PyAny>, name: &str, columns: usize) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    array(value, name, &[None, Some(columns)])
}

/// A matrix.
pub fn matrix<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    (rows, columns): (usize, usize),
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    array(value, name, &[Some(rows), Some(columns)])
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
