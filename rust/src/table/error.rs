//! What can be wrong with a table, and where.

use std::fmt;
use std::io;

use thiserror::Error;

/// Whether the bytes that come out are those of the file or unpacked ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unpacking {
    Plain,
    Gzip,
}

/// A fault with its place in the file. The text names neither the file nor its folder; the caller knows them.
#[derive(Debug, Error)]
pub struct TableError {
    /// Line of the (unpacked) file, from 1.
    pub line: Option<u64>,
    /// Heading of the column.
    pub column: Option<String>,
    /// Whether the line is the last one and has no line end: the file may have been cut off there.
    pub cut: bool,
    /// What is wrong.
    #[source]
    pub fault: Fault,
}

impl fmt::Display for TableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.line, &self.column) {
            (Some(line), Some(column)) => write!(f, "line {line}, column '{column}': ")?,
            (Some(line), None) => write!(f, "line {line}: ")?,
            _ => {}
        }
        write!(f, "{}", self.fault)?;
        if self.cut {
            write!(f, "; the file ends inside this line: was it cut off, or is it still being written?")?;
        }
        Ok(())
    }
}

/// What is wrong: what was found, what is allowed, what to do.
#[derive(Debug, Error)]
pub enum Fault {
    /// No file of that name.
    #[error("there is no such file")]
    Missing,
    /// A folder.
    #[error("is a folder; name a file in it")]
    NotAFile,
    /// The operating system refused.
    #[error("cannot be read: {0}")]
    Io(io::Error),
    /// Nothing but blanks.
    #[error("the file is empty; expected a line of headings and lines of numbers")]
    Empty,
    /// Some other kind of file: what it is, and what to do.
    #[error("is not a text file but {0}; expected CSV, plain or gzip: {1}")]
    Binary(&'static str, &'static str),
    /// The first line is not UTF-8.
    #[error("the headings are not UTF-8 text; save the file as UTF-8")]
    HeadingsNotText,
    /// Headings alone.
    #[error("has headings but no rows of numbers")]
    NoRows,
    /// A line with too many or too few fields.
    #[error("found {found} field{}; the headings have {expected}: mend the line or remove it", if *found == 1 { "" } else { "s" })]
    FieldCount {
        /// Fields in the headings.
        expected: usize,
        /// Fields in the line.
        found: usize,
    },
    /// A cell that goes on over several lines.
    #[error("a quotation mark opens here and is not closed on this line; remove it")]
    OpenQuote,
    /// A cell without a value, and what to do.
    #[error("the cell is empty; {0}")]
    EmptyCell(String),
    /// A cell that says that there is no value, such as NaN.
    #[error("found {found:?}, no value; {advice}")]
    NoValue {
        /// The cell.
        found: String,
        /// What to do.
        advice: String,
    },
    /// A cell with something else than a number.
    #[error("found {0:?}; expected a number such as -1.5 or 2.5e3")]
    NotANumber(String),
    /// Infinity, or a number beyond the range of f64.
    #[error("found {0:?}; expected a finite number: write the last known value or remove the row")]
    NotFinite(String),
    /// A value that the quantity cannot have.
    #[error("found {found:?}, below the least possible value {least:?}; {hint}")]
    TooSmall {
        /// The value.
        found: f64,
        /// The limit.
        least: f64,
        /// Why, and what to do.
        hint: String,
    },
    /// A time before the one above it.
    #[error("time runs backwards, from {previous:?} to {found:?}; times may repeat but not decrease")]
    Backwards {
        /// The time before.
        previous: f64,
        /// The time found.
        found: f64,
    },
    /// A line that does not end.
    #[error("no line end within 16 MiB: a quote is not closed, or this is not a CSV file")]
    LineTooLong,
    /// The gzip data stops in the middle.
    #[error("the gzip data ends too early: the file was cut off")]
    GzipCut,
    /// The gzip data contradicts itself.
    #[error("the gzip data is damaged: {0}")]
    GzipDamaged(String),
    /// The watcher said stop.
    #[error("stopped")]
    Stopped,
}

impl From<Fault> for TableError {
    fn from(fault: Fault) -> Self {
        Self { line: None, column: None, cut: false, fault }
    }
}

impl Fault {
    pub(super) fn at(self, line: u64) -> TableError {
        TableError { line: Some(line), ..self.into() }
    }

    /// What a failed read means, given whether the bytes come out of a gzip file.
    pub(super) fn from_io(error: io::Error, unpacking: Unpacking) -> Self {
        if error.get_ref().is_some_and(|inner| inner.is::<LineTooLong>()) {
            return Self::LineTooLong;
        }
        match (unpacking, error.kind()) {
            (Unpacking::Gzip, io::ErrorKind::UnexpectedEof) => Self::GzipCut,
            (Unpacking::Gzip, io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData) => {
                Self::GzipDamaged(error.to_string())
            }
            _ => Self::Io(error),
        }
    }
}

/// Carries [`Fault::LineTooLong`] through the reader of lines.
#[derive(Debug, Error)]
#[error("line too long")]
pub(super) struct LineTooLong;
