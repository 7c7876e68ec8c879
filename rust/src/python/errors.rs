//! The core's errors as the exceptions of `bha.errors`.

use crate::error::Error;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

/// The exception class `name` of `bha.errors`.
fn class<'py>(py: Python<'py>, cell: &'static PyOnceLock<Py<PyType>>, name: &str) -> PyResult<&'py Bound<'py, PyType>> {
    cell.import(py, "bha.errors", name)
}

static BASE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static PARAMETER: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static INPUT: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static SIMULATION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static LOG: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static CONVERGENCE: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// `error` as a Python exception.
pub fn to_python(py: Python<'_>, error: &Error) -> PyErr {
    let text = error.to_string();
    let (cell, name) = match error {
        Error::Parameter { .. } | Error::Effect { .. } => (&PARAMETER, "ParameterError"),
        Error::Input(_) => (&INPUT, "InputError"),
        Error::Convergence(_) => (&CONVERGENCE, "ConvergenceError"),
        Error::Simulation { .. } => (&SIMULATION, "SimulationError"),
        Error::Interrupted => return pyo3::exceptions::PyKeyboardInterrupt::new_err(()),
    };
    match class(py, cell, name) {
        Ok(class) => match error {
            Error::Simulation { time, .. } => PyErr::from_type(class.clone(), (text, *time)),
            _ => PyErr::from_type(class.clone(), (text,)),
        },
        Err(import) => import,
    }
}

/// `error` as an exception to hand over rather than to raise.
///
/// # Errors
/// What came up while the exception was made, since that runs Python code: Ctrl-C above all, which must not be taken for it.
pub fn failure(py: Python<'_>, error: &Error) -> PyResult<Py<PyAny>> {
    let made = to_python(py, error).into_value(py).into_any();
    if made.bind(py).is_instance(class(py, &BASE, "BhaError")?)? {
        return Ok(made);
    }
    Err(PyErr::from_value(made.into_bound(py)))
}

/// A `LogError`.
pub fn log(py: Python<'_>, text: String) -> PyErr {
    class(py, &LOG, "LogError").map_or_else(|import| import, |class| PyErr::from_type(class.clone(), (text,)))
}

/// An `InputError`.
pub fn input(py: Python<'_>, text: String) -> PyErr {
    to_python(py, &Error::Input(text))
}
