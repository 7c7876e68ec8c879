//! Lines of text to columns of numbers.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use csv::ByteRecord;

use super::error::{Fault, TableError, Unpacking};
use super::layout::Layout;
use super::source::{self, Counts};

/// Time between two calls of the watcher: often enough to stop within a tenth of a second.
const WATCH_INTERVAL: Duration = Duration::from_millis(50);
/// Bytes taken from the file at a time; well below what is parsed in one interval.
const BUFFER: usize = 256 << 10;
/// Characters of a faulty cell that are shown.
const SHOWN: usize = 40;
/// What programs write, beside nothing, where there is no value; in any case.
const NO_VALUE: [&str; 10] = ["nan", "na", "n/a", "#n/a", "null", "none", "-", "-nan", "nan(ind)", "-nan(ind)"];

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnUse {
    /// Not read at all.
    Skip,
    /// Every cell must be a finite number.
    Number,
    /// Like `Number`, and no value may be less than the one before.
    Time,
    /// Read as far as it goes: cells without a value are NaN, and one that is no finite number ends the reading of this
    /// column.
    Free,
}

/// What a column is for and what it may hold.
#[derive(Clone, Debug)]
pub struct Column {
    /// What it is for.
    pub used: ColumnUse,
    /// Least possible value of a `Number`; negative infinity for no limit.
    pub least: f64,
    /// What to say of a smaller value: why it cannot be, what to do.
    pub hint: String,
    /// Whether cells without a value are missing samples, NaN, and no fault.
    pub missing: bool,
    /// What to say of a cell without a value where that is a fault: what to do.
    pub absent: String,
}

/// What came of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum ReadColumn {
    /// It was not asked for.
    Skipped,
    /// One number per row.
    Numbers(Vec<f64>),
    /// A free column that holds something else than numbers: where, and what.
    Text {
        /// Line of the file.
        line: u64,
        /// The first cell that is not a number, clipped.
        found: String,
    },
}

/// A table read from a file.
#[derive(Clone, Debug)]
pub struct Table {
    /// Number of rows.
    pub rows: usize,
    /// The columns in the order of the file.
    pub columns: Vec<ReadColumn>,
    /// Whether the last line has no line end, so that its last number may have been cut.
    pub unterminated: bool,
}

/// A file of which the headings have been read.
pub struct TableReader {
    lines: csv::Reader<Box<dyn std::io::Read + Send>>,
    counts: Arc<Counts>,
    unpacking: Unpacking,
    size: u64,
    opening: Vec<String>,
    headings: Vec<String>,
    layout: Layout,
    /// Bytes of text before the headings.
    skipped: u64,
}

impl TableReader {
    /// Open a file and read its headings.
    ///
    /// # Errors
    /// The file is missing, empty or not text.
    pub fn open(path: &Path) -> Result<Self, TableError> {
        Self::open_as(path, Layout::default())
    }

    /// The same for a table that is laid out in another way. Headings that are not UTF-8 are read as Latin-1 there.
    ///
    /// # Errors
    /// As for [`Self::open`].
    pub fn open_as(path: &Path, layout: Layout) -> Result<Self, TableError> {
        let source::Source { text, counts, unpacking, size, opening } = source::open(path)?;
        let (text, skipped) = source::after_lines(text, layout.headings_line - 1)
            .map_err(|error| Fault::from_io(error, unpacking).at(layout.headings_line))?;
        let mut lines = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(layout.separator)
            .buffer_capacity(BUFFER)
            .from_reader(text);
        let mut record = ByteRecord::new();
        let before = layout.headings_line - 1;
        lines.read_byte_record(&mut record).map_err(|error| read_fault(error, unpacking, before + 1))?;
        let headings = record
            .iter()
            .map(|field| heading(field, &layout))
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| Fault::HeadingsNotText.at(before + 1))?;
        while lines.position().line() + before < layout.numbers_line {
            let line = lines.position().line() + before;
            if !lines.read_byte_record(&mut record).map_err(|error| read_fault(error, unpacking, line))? {
                break;
            }
        }
        Ok(Self { lines, counts, unpacking, size, opening, headings, layout, skipped })
    }

    /// The first lines of the file as they stand, each clipped: where the headings are to be looked for if they are not
    /// in the first one.
    #[must_use]
    pub fn opening(&self) -> &[String] {
        &self.opening
    }

    /// The headings in the order of the file, without surrounding blanks.
    #[must_use]
    pub fn headings(&self) -> &[String] {
        &self.headings
    }

    /// Read all rows. `columns` says for each heading what to do with its column; `watch` gets the bytes read so far and
    /// the size of the file, at the start, about every 50 ms and at the end, and can stop the reading.
    ///
    /// # Errors
    /// The first fault in the file, with line and column; [`Fault::Stopped`] if the watcher said so.
    ///
    /// # Panics
    /// If `columns` has not one entry per heading.
    pub fn read(
        mut self,
        columns: &[Column],
        watch: &mut (dyn FnMut(u64, u64) -> ControlFlow<()> + Send),
    ) -> Result<Table, TableError> {
        assert_eq!(columns.len(), self.headings.len(), "one column for each heading");
        let mut found: Vec<ReadColumn> = columns
            .iter()
            .map(|column| match column.used {
                ColumnUse::Skip => ReadColumn::Skipped,
                _ => ReadColumn::Numbers(Vec::new()),
            })
            .collect();
        let mut record = ByteRecord::new();
        let mut rows = 0;
        let mut clock = Instant::now();
        let mut seen = 0;
        stopped(watch(self.counts.on_disk.get(), self.size))?;
        loop {
            self.counts.line_start.set(self.skipped + self.lines.position().byte());
            let line = self.before() + self.lines.position().line();
            if !self.lines.read_byte_record(&mut record).map_err(|error| read_fault(error, self.unpacking, line))? {
                break;
            }
            let line = self.line_of_last_record();
            self.append(&record, line, columns, &mut found)?;
            rows += 1;
            // Time is asked for once per buffer, not once per row.
            if self.counts.text.get() != seen {
                seen = self.counts.text.get();
                if clock.elapsed() >= WATCH_INTERVAL {
                    stopped(watch(self.counts.on_disk.get(), self.size))?;
                    clock = Instant::now();
                }
            }
        }
        if rows == 0 {
            return Err(Fault::NoRows.into());
        }
        for column in &mut found {
            if let ReadColumn::Numbers(numbers) = column {
                numbers.shrink_to_fit();
            }
        }
        stopped(watch(self.size, self.size))?;
        Ok(Table { rows, columns: found, unterminated: self.counts.last.get() != u64::from(b'\n') })
    }

    /// Line of the record just read, for records of one line, as all rows of numbers are.
    ///
    /// The reader's own position of a record is where it began to look for it, before any blank lines.
    fn line_of_last_record(&self) -> u64 {
        // A last line may have no end at all.
        let unterminated = self.counts.last.get() != u64::from(b'\n') && self.at_end();
        self.before() + self.lines.position().line() - u64::from(!unterminated)
    }

    /// Whether all of the text has been taken.
    fn at_end(&self) -> bool {
        self.skipped + self.lines.position().byte() >= self.counts.text.get()
    }

    /// Lines before the headings.
    fn before(&self) -> u64 {
        self.layout.headings_line - 1
    }

    /// Whether a line that has not one field for each heading can be read all the same: what is too much is blank, what
    /// is not there nobody needs.
    fn fits(&self, record: &ByteRecord, columns: &[Column]) -> bool {
        if self.layout.is_plain() {
            return false;
        }
        let blank = record.iter().skip(columns.len()).all(|field| without_blanks(field).is_empty());
        let needless = |column: &Column| matches!(column.used, ColumnUse::Skip | ColumnUse::Free);
        blank && columns.iter().skip(record.len()).all(needless)
    }

    fn append(
        &mut self,
        record: &ByteRecord,
        line: u64,
        columns: &[Column],
        found: &mut [ReadColumn],
    ) -> Result<(), TableError> {
        if record.len() != columns.len() && !self.fits(record, columns) {
            // A quote that stays open takes the lines below into its cell.
            let ends = record.iter().flatten().filter(|&&byte| byte == b'\n').count() as u64;
            if ends > 0 {
                // The end of the last line begins no other one.
                let to_the_end = self.at_end() && record.iter().next_back().is_some_and(|field| field.ends_with(b"\n"));
                return Err(Fault::OpenQuote.at(line + u64::from(to_the_end) - ends));
            }
            let fault = Fault::FieldCount { expected: columns.len(), found: record.len() };
            return Err(self.locate(fault, line, None));
        }
        for (index, (column, found)) in columns.iter().zip(found).enumerate() {
            let field = record.get(index).unwrap_or_default();
            let ReadColumn::Numbers(numbers) = found else {
                continue;
            };
            if column.used == ColumnUse::Free {
                match parse(field, self.layout.decimal_comma) {
                    Cell::Number(number) => numbers.push(number),
                    Cell::Absent => numbers.push(f64::NAN),
                    Cell::Infinite | Cell::Other => *found = ReadColumn::Text { line, found: shown(field) },
                }
                continue;
            }
            let number = match parse(field, self.layout.decimal_comma) {
                Cell::Number(number) => check(number, column, numbers.last()),
                Cell::Absent if column.missing => Ok(f64::NAN),
                Cell::Absent => Err(absent(field, column)),
                Cell::Infinite => Err(Fault::NotFinite(shown(field))),
                Cell::Other => Err(Fault::NotANumber(shown(field))),
            };
            numbers.push(number.map_err(|fault| self.locate(fault, line, Some(index)))?);
        }
        Ok(())
    }

    /// A fault with its place; whether the line is cut is found out by looking for a next one.
    fn locate(&mut self, fault: Fault, line: u64, column: Option<usize>) -> TableError {
        let mut next = ByteRecord::new();
        let is_last = matches!(self.lines.read_byte_record(&mut next), Ok(false));
        TableError {
            line: Some(line),
            column: column.map(|index| self.headings[index].clone()),
            cut: is_last && self.counts.last.get() != u64::from(b'\n'),
            fault,
        }
    }
}

fn heading(field: &[u8], layout: &Layout) -> Option<String> {
    let text = match std::str::from_utf8(field) {
        Ok(text) => text.to_owned(),
        Err(_) if layout.is_plain() => return None,
        Err(_) => field.iter().map(|&byte| char::from(byte)).collect(),
    };
    Some(text.trim().to_owned())
}

fn read_fault(error: csv::Error, unpacking: Unpacking, line: u64) -> TableError {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => Fault::from_io(error, unpacking).at(line),
        // The reader takes rows of any length as bytes, so that reading is all that can fail.
        other => Fault::Io(std::io::Error::other(format!("{other:?}"))).at(line),
    }
}

fn stopped(flow: ControlFlow<()>) -> Result<(), TableError> {
    if flow.is_break() { Err(Fault::Stopped.into()) } else { Ok(()) }
}

/// What stands in a cell.
enum Cell {
    /// A finite number.
    Number(f64),
    /// Nothing, or a word for it.
    Absent,
    /// Infinity, or a number beyond the range of f64.
    Infinite,
    /// Something else.
    Other,
}

fn parse(field: &[u8], decimal_comma: bool) -> Cell {
    let field = without_blanks(field);
    let Ok(mut text) = std::str::from_utf8(field) else {
        return Cell::Other;
    };
    let with_point;
    if decimal_comma && text.bytes().any(|byte| byte == b',' || byte == b'.') {
        if text.contains('.') {
            return Cell::Other;
        }
        with_point = text.replacen(',', ".", 1);
        text = &with_point;
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Cell::Number(number),
        Ok(number) if number.is_infinite() => Cell::Infinite,
        _ if text.is_empty() || NO_VALUE.iter().any(|word| word.eq_ignore_ascii_case(text)) => Cell::Absent,
        _ => Cell::Other,
    }
}

fn absent(field: &[u8], column: &Column) -> Fault {
    let advice = column.absent.clone();
    match shown(field) {
        found if found.is_empty() => Fault::EmptyCell(advice),
        found => Fault::NoValue { found, advice },
    }
}

fn check(number: f64, column: &Column, previous: Option<&f64>) -> Result<f64, Fault> {
    if number < column.least {
        return Err(Fault::TooSmall { found: number, least: column.least, hint: column.hint.clone() });
    }
    match previous {
        Some(&previous) if column.used == ColumnUse::Time && number < previous => {
            Err(Fault::Backwards { previous, found: number })
        }
        _ => Ok(number),
    }
}

/// Without surrounding blanks. Line ends stay: within a cell they come from a quote that is not closed.
fn without_blanks(mut field: &[u8]) -> &[u8] {
    while let [b' ' | b'\t', rest @ ..] | [rest @ .., b' ' | b'\t'] = field {
        field = rest;
    }
    field
}

fn shown(field: &[u8]) -> String {
    let text = String::from_utf8_lossy(without_blanks(field));
    if text.chars().count() <= SHOWN {
        text.into_owned()
    } else {
        text.chars().take(SHOWN).chain("...".chars()).collect()
    }
}
