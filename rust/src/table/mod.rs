//! Tables of numbers in text files: a line of headings, then lines of numbers separated by commas, plain or gzip.
//!
//! Built for long measured logs: one pass, one growing vector per column and nothing else that grows with the file, and
//! a watcher that is called often enough to show progress and to stop within a tenth of a second. What the headings mean
//! (quantities, units) is the caller's business.
//!
//! `layout.rs` says how a table may be laid out, `source.rs` opens files and unpacks them, `read.rs` turns lines into columns, `format.rs` turns columns into lines,
//! `error.rs` says what can be wrong and where.

mod error;
mod format;
mod layout;
mod read;
mod source;

pub use error::{Fault, TableError};
pub use format::format_rows;
pub use layout::Layout;
pub use read::{Column, ColumnUse, ReadColumn, Table, TableReader};

#[cfg(test)]
mod tests;
