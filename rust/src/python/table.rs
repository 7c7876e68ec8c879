//! Reading and writing tables of numbers, for measured logs and trajectories.

use std::ops::ControlFlow;
use std::path::PathBuf;

use numpy::IntoPyArray;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use super::arrays::any_numbers;
use super::errors::log;
use crate::table::{Column, ColumnUse, Fault, Layout, ReadColumn, TableError, TableReader, format_rows};

pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<Table>()?;
    m.add_class::<TableColumn>()?;
    m.add_class::<TextFound>()?;
    m.add_function(wrap_pyfunction!(read_table, m)?)?;
    m.add_function(wrap_pyfunction!(format_table_rows, m)?)
}

/// What is wanted of a column: its use ("skip", "number", "time" or "free"), the least value it may have, what to say of a
/// smaller one, whether samples may be missing, and what to say of one that is and may not.
#[pyclass(module = "bha._core", frozen)]
pub struct TableColumn(Column);

#[pymethods]
impl TableColumn {
    #[new]
    fn new(used: &str, least: f64, hint: String, missing: bool, absent: String) -> PyResult<Self> {
        Ok(Self(Column { used: column_use(used)?, least, hint, missing, absent }))
    }
}

/// What stands in a free column that holds something else than numbers.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct TextFound {
    /// Line of the file.
    line: u64,
    /// The first cell that is no number, clipped.
    text: String,
}

/// A table as it was read.
#[pyclass(module = "bha._core", frozen, get_all)]
pub struct Table {
    /// For each heading an array, None where it was skipped, or `TextFound`.
    columns: Vec<Py<PyAny>>,
    /// Whether the last line has no end.
    unterminated: bool,
}

/// Read a table of numbers from a CSV file, plain or gzip.
///
/// `plan` gets the headings and the first lines as they stand, and returns a `TableColumn` for each heading. `progress`
/// gets the fraction of the file that is done. Errors call the file `name`. `layout` is the separator, whether numbers have
/// decimal commas, and the lines of the headings and of the first numbers; None for plain CSV. Raises LogError; what `plan`
/// and `progress` raise comes back as it is.
#[pyfunction]
#[pyo3(signature = (path, plan, progress=None, name=None, layout=None))]
fn read_table<'py>(
    py: Python<'py>,
    path: PathBuf,
    plan: &Bound<'py, PyAny>,
    progress: Option<Py<PyAny>>,
    name: Option<String>,
    layout: Option<(char, bool, u64, u64)>,
) -> PyResult<Table> {
    let layout = layout.map(layout_of).transpose()?.unwrap_or_default();
    let name = name.unwrap_or_else(|| path.display().to_string());
    let wrong = |py: Python<'_>, error: &TableError| log_error(py, &name, error);
    let reader = TableReader::open_as(&path, layout).map_err(|error| wrong(py, &error))?;
    let columns = plan
        .call1((reader.headings().to_vec(), reader.opening().to_vec()))?
        .extract::<Vec<Bound<'_, TableColumn>>>()?
        .iter()
        .map(|column| column.get().0.clone())
        .collect::<Vec<_>>();
    if columns.len() != reader.headings().len() {
        return Err(PyValueError::new_err("the plan must have one entry for each heading"));
    }
    let mut raised = None;
    let mut watch = |done: u64, size: u64| {
        let told = Python::attach(|py| {
            py.check_signals()?;
            let Some(call) = &progress else { return Ok(()) };
            call.call1(py, (done as f64 / size.max(1) as f64,)).map(drop)
        });
        match told {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                raised = Some(error);
                ControlFlow::Break(())
            }
        }
    };
    let table = py.detach(|| reader.read(&columns, &mut watch));
    if let Some(error) = raised {
        return Err(error);
    }
    let table = table.map_err(|error| wrong(py, &error))?;
    let column = |column| -> PyResult<Py<PyAny>> {
        Ok(match column {
            ReadColumn::Skipped => py.None(),
            ReadColumn::Numbers(numbers) => numbers.into_pyarray(py).into_any().unbind(),
            ReadColumn::Text { line, found: text } => Py::new(py, TextFound { line, text })?.into_any(),
        })
    };
    let columns = table.columns.into_iter().map(column).collect::<PyResult<_>>()?;
    Ok(Table { columns, unterminated: table.unterminated })
}

/// Lines of text for a block of rows: fields separated by commas, each number in the fewest digits that read back to
/// the same number, nothing for NaN. `columns` are arrays of numbers of one length.
#[pyfunction]
fn format_table_rows<'py>(py: Python<'py>, columns: Vec<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyBytes>> {
    let read = |(k, column)| any_numbers(column, &format!("columns[{k}]"));
    let columns = columns.iter().enumerate().map(read).collect::<PyResult<Vec<_>>>()?;
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    if columns.windows(2).any(|pair| pair[0].len() != pair[1].len()) {
        return Err(PyValueError::new_err("the columns differ in length"));
    }
    let mut text = Vec::new();
    py.detach(|| format_rows(&columns, &mut text));
    Ok(PyBytes::new(py, &text))
}

fn layout_of(given: (char, bool, u64, u64)) -> PyResult<Layout> {
    let (separator, decimal_comma, headings_line, numbers_line) = given;
    let separator = u8::try_from(separator).ok().filter(|byte| matches!(byte, b',' | b';' | b'\t'));
    match separator {
        Some(separator) if 0 < headings_line && headings_line < numbers_line => {
            Ok(Layout { separator, decimal_comma, headings_line, numbers_line })
        }
        _ => Err(PyValueError::new_err("a layout is (',', ';' or tab, decimal commas, line of headings, of numbers)")),
    }
}

fn column_use(name: &str) -> PyResult<ColumnUse> {
    match name {
        "skip" => Ok(ColumnUse::Skip),
        "number" => Ok(ColumnUse::Number),
        "time" => Ok(ColumnUse::Time),
        "free" => Ok(ColumnUse::Free),
        other => Err(PyValueError::new_err(format!("unknown use of a column: {other:?}"))),
    }
}

fn log_error(py: Python<'_>, path: &str, error: &TableError) -> PyErr {
    let separator = match error.fault {
        _ if error.line.is_some() => ", ",
        Fault::NotAFile | Fault::Binary(..) | Fault::NoRows => " ",
        _ => ": ",
    };
    log(py, format!("{path}{separator}{error}"))
}
