//! Tables read and written, and every fault with its place.

use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;

use super::{Column, ColumnUse, Fault, Layout, ReadColumn, Table, TableError, TableReader, format_rows};

const TIME: Column = column(ColumnUse::Time);
const NUMBER: Column = column(ColumnUse::Number);
const FREE: Column = column(ColumnUse::Free);
const SKIP: Column = column(ColumnUse::Skip);

const fn column(used: ColumnUse) -> Column {
    Column { used, least: f64::NEG_INFINITY, hint: String::new(), missing: false, absent: String::new() }
}

/// A file that is removed with its handle.
struct Temporary(PathBuf);

impl Temporary {
    fn new(content: &[u8]) -> Self {
        use std::sync::atomic::{AtomicU64, Ordering};
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("bha_table_{}_{number}", std::process::id()));
        std::fs::write(&path, content).unwrap();
        Self(path)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn read_path(path: &Path, columns: &[Column]) -> Result<Table, TableError> {
    TableReader::open(path)?.read(columns, &mut |_, _| ControlFlow::Continue(()))
}

fn read(content: &[u8], columns: &[Column]) -> Result<Table, TableError> {
    read_path(&Temporary::new(content).0, columns)
}

fn text(content: &[u8], columns: &[Column]) -> String {
    read(content, columns).unwrap_err().to_string()
}

fn packed(content: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

fn numbers(column: &ReadColumn) -> &[f64] {
    match column {
        ReadColumn::Numbers(numbers) => numbers,
        other => panic!("{other:?}"),
    }
}

#[test]
fn columns_come_as_they_stand() {
    let table =
        read(b"\xef\xbb\xbft, a ,b,c\r\n0,1,x,\r\n\r\n0, +2.5e-3 ,y,nan\r\n", &[TIME, NUMBER, SKIP, FREE]).unwrap();
    assert_eq!(table.rows, 2);
    assert!(!table.unterminated);
    assert_eq!(numbers(&table.columns[0]), [0.0, 0.0]);
    assert_eq!(numbers(&table.columns[1]), [1.0, 2.5e-3]);
    assert_eq!(table.columns[2], ReadColumn::Skipped);
    assert!(numbers(&table.columns[3]).iter().all(|number| number.is_nan()));
}

#[test]
fn headings_may_be_quoted_and_lose_their_blanks() {
    let file = Temporary::new(b" \"t [s]\" ,\"p11 [kPa(g)]\"\n0,1\n");
    let reader = TableReader::open(&file.0).unwrap();
    assert_eq!(reader.headings()[1], "p11 [kPa(g)]");
}

#[test]
fn samples_may_be_missing_where_the_caller_says_so() {
    let gaps = [TIME, Column { missing: true, ..NUMBER }];
    let words = ["", " ", "NaN", "nan", "-nan", "-nan(ind)", "NA", "N/A", "#N/A", "null", "None", "-"];
    let mut content = b"t,a\n0,1\n".to_vec();
    for word in words {
        content.extend(format!("1,{word}\n").into_bytes());
    }
    let table = read(&content, &gaps).unwrap();
    assert_eq!(numbers(&table.columns[1]).iter().filter(|number| number.is_nan()).count(), words.len());
    assert_eq!(numbers(&table.columns[1])[0], 1.0);
    for wrong in ["inf", "-Infinity", "1e999"] {
        let fault = read(format!("t,a\n0,{wrong}\n").as_bytes(), &gaps).unwrap_err().fault;
        assert!(matches!(fault, Fault::NotFinite(_)), "{fault}");
        let table = read(format!("t,a\n0,{wrong}\n").as_bytes(), &[TIME, FREE]).unwrap();
        assert_eq!(table.columns[1], ReadColumn::Text { line: 2, found: wrong.into() });
    }
    assert!(matches!(read(b"t,a\n0,--\n", &gaps).unwrap_err().fault, Fault::NotANumber(_)));
    assert!(matches!(read(b"t,a\n,1\n", &gaps).unwrap_err().fault, Fault::EmptyCell(_)));
}

#[test]
fn lines_of_the_old_mac_are_lines() {
    let table = read(b"t,a\r0,1\r1,2\r", &[TIME, NUMBER]).unwrap();
    assert_eq!((table.rows, table.unterminated), (2, false));
    assert!(read(b"t,a\r0,1\r1,2", &[TIME, NUMBER]).unwrap().unterminated);
    assert_eq!(read(b"t,a\r0,1\r\r1,x\r", &[TIME, NUMBER]).unwrap_err().line, Some(4));
}

#[test]
fn the_opening_shows_what_stands_above_the_headings() {
    let file = Temporary::new(b"\xef\xbb\xbfsep=;\r\n\r\nt;a\r\n0;1\r\n");
    assert_eq!(TableReader::open(&file.0).unwrap().opening(), ["sep=;", "", "t;a", "0;1", ""]);
}

#[test]
fn a_free_column_of_text_says_where() {
    let table = read(b"t,note\n0,1\n1,start\n2,3\n", &[TIME, FREE]).unwrap();
    assert_eq!(table.columns[1], ReadColumn::Text { line: 3, found: "start".into() });
}

#[test]
fn gzip_is_known_by_its_bytes_and_may_have_several_members() {
    let mut content = packed(b"t,a\n0,1\n");
    content.extend(packed(b"1,2\n"));
    let table = read(&content, &[TIME, NUMBER]).unwrap();
    assert_eq!(numbers(&table.columns[1]), [1.0, 2.0]);
}

#[test]
fn faults_name_line_and_column() {
    let columns = [TIME, Column { least: -1.0, hint: "check it".into(), absent: "remove the row".into(), ..NUMBER }];
    let cases: [(&[u8], &str); 16] = [
        (b"t,a\n0,1\n1,x\n2,3\n", "line 3, column 'a': found \"x\"; expected a number such as -1.5 or 2.5e3"),
        (
            b"t,a\n0,1\n\n1,Inf\n2,3\n",
            "line 4, column 'a': found \"Inf\"; expected a finite number: write the last known value or remove the row",
        ),
        (b"t,a\n0,1\n\n1, n/a\n2,3\n", "line 4, column 'a': found \"n/a\", no value; remove the row"),
        (
            b"t,a\n0,1e999\n",
            "line 2, column 'a': found \"1e999\"; expected a finite number: write the last known value or remove the row",
        ),
        (b"t,a\n0, \n1,2\n", "line 2, column 'a': the cell is empty; remove the row"),
        (
            b"t,a\n0,1\n1,2\n0.5,3\n",
            "line 4, column 't': time runs backwards, from 1.0 to 0.5; times may repeat but not decrease",
        ),
        (b"t,a\n0,-2\n", "line 2, column 'a': found -2.0, below the least possible value -1.0; check it"),
        (b"t,a\n0,1,2\n1,2\n", "line 2: found 3 fields; the headings have 2: mend the line or remove it"),
        (
            b"t,a\n0,1\n1",
            "line 3: found 1 field; the headings have 2: mend the line or remove it; the file ends inside this line: was it cut off, or is it still being written?",
        ),
        (
            b"t,a\n0,1\n1,2e",
            "line 3, column 'a': found \"2e\"; expected a number such as -1.5 or 2.5e3; the file ends inside this line: was it cut off, or is it still being written?",
        ),
        (b"t,a\n0,\"1\n", "line 2, column 'a': found \"1\\n\"; expected a number such as -1.5 or 2.5e3"),
        (
            b"t,a\n0,1\n\"1,2\n2,3\n3,4\n",
            "line 3: a quotation mark opens here and is not closed on this line; remove it",
        ),
        (
            b"t,a\n0,1\n\n\"1,2\n2,3\n3,4",
            "line 4: a quotation mark opens here and is not closed on this line; remove it",
        ),
        (b"t,a\n", "has headings but no rows of numbers"),
        (b" \n\n", "the file is empty; expected a line of headings and lines of numbers"),
        (b"t,\xb5\n0,1\n", "line 1: the headings are not UTF-8 text; save the file as UTF-8"),
    ];
    for (content, expected) in cases {
        assert_eq!(text(content, &columns), expected);
    }
}

#[test]
fn lines_are_counted_as_an_editor_counts_them() {
    for content in [
        "t,a\n0,1\n\n\n1,x\n2,3\n",
        "t,a\r\n0,1\r\n\r\n\r\n1,x\r\n2,3\r\n",
        "t,a\r0,1\r\r\r1,x\r2,3\r",
        "t,a\r\n0,1\n\r\n\r1,x\n2,3\r\n",
        "t,a\n0,1\r\n\n\r\n1,x\r\n2,3\n",
        "t,a\n0,1\n\n\n1,x",
    ] {
        assert_eq!(read(content.as_bytes(), &[TIME, NUMBER]).unwrap_err().line, Some(5), "{content:?}");
        assert_eq!(
            read(content.as_bytes(), &[TIME, FREE]).unwrap().columns[1],
            ReadColumn::Text { line: 5, found: "x".into() }
        );
    }
}

#[test]
fn other_kinds_of_files_are_named() {
    let cases: [(&[u8], &str); 4] = [
        (
            b"PK\x03\x04rest",
            "is not a text file but a zip archive or a spreadsheet (.xlsx); expected CSV, plain or gzip: unpack it, or save the sheet as CSV",
        ),
        (b"t,a\n\0\0", "is not a text file but binary data; expected CSV, plain or gzip: is it the right file?"),
        (b"\xff\xfet\0", "is not a text file but UTF-16 text; expected CSV, plain or gzip: save it as UTF-8"),
        (b"", "the file is empty; expected a line of headings and lines of numbers"),
    ];
    for (content, expected) in cases {
        assert_eq!(text(content, &[TIME, NUMBER]), expected);
    }
    assert_eq!(read_path(Path::new("/nowhere/at/all"), &[]).unwrap_err().to_string(), "there is no such file");
    assert_eq!(read_path(&std::env::temp_dir(), &[]).unwrap_err().to_string(), "is a folder; name a file in it");
}

#[test]
fn damaged_gzip_is_named() {
    let rows: String = (0..50_000).map(|i| format!("{i},{}\n", f64::from(i).sin())).collect();
    let whole = packed(format!("t,a\n{rows}").as_bytes());
    let cut = text(&whole[..whole.len() / 2], &[TIME, NUMBER]);
    assert!(cut.ends_with("the gzip data ends too early: the file was cut off"), "{cut}");
    let mut damaged = whole.clone();
    let middle = whole.len() / 2;
    damaged[middle..middle + 64].fill(0xff);
    let error = read(&damaged, &[TIME, NUMBER]).unwrap_err();
    assert!(!matches!(error.fault, Fault::Io(_)), "{error}");
}

#[test]
fn an_unclosed_quote_ends_in_an_error_not_in_memory() {
    let mut content = b"t,a\n0,\"1\n".to_vec();
    content.resize(40 << 20, b'7');
    assert!(matches!(read(&content, &[TIME, NUMBER]).unwrap_err().fault, Fault::LineTooLong));
}

#[test]
fn the_watcher_sees_start_and_end_and_can_stop() {
    let file = Temporary::new(b"t,a\n0,1\n");
    let mut calls = Vec::new();
    let reader = TableReader::open(&file.0).unwrap();
    reader
        .read(&[TIME, NUMBER], &mut |done, size| {
            calls.push((done, size));
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(calls, [(8, 8), (8, 8)]);
    let reader = TableReader::open(&file.0).unwrap();
    let error = reader.read(&[TIME, NUMBER], &mut |_, _| ControlFlow::Break(())).unwrap_err();
    assert!(matches!(error.fault, Fault::Stopped));
}

#[test]
fn a_last_line_without_end_is_told() {
    assert!(read(b"t,a\n0,1\n1,2", &[TIME, NUMBER]).unwrap().unterminated);
}

proptest! {
    #[test]
    fn what_is_written_reads_back_to_the_last_bit(
        rows in prop::collection::vec((any::<f64>(), any::<f64>()), 1..50)
    ) {
        let finite = |number: f64| if number.is_infinite() { 0.0 } else { number };
        let a: Vec<f64> = rows.iter().map(|row| finite(row.0)).collect();
        let b: Vec<f64> = rows.iter().map(|row| finite(row.1)).collect();
        let mut content = b"a,b\n".to_vec();
        format_rows(&[&a, &b], &mut content);
        let table = read(&content, &[FREE, FREE]).unwrap();
        for (found, written) in table.columns.iter().zip([a, b]) {
            for (x, y) in numbers(found).iter().zip(written) {
                prop_assert!(x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan()));
            }
        }
    }
}

fn read_as(content: &[u8], layout: Layout, columns: &[Column]) -> Result<Table, TableError> {
    TableReader::open_as(&Temporary::new(content).0, layout)?.read(columns, &mut |_, _| ControlFlow::Continue(()))
}

#[test]
fn other_layouts_are_read_where_they_begin() {
    let layout = Layout { separator: b';', decimal_comma: true, headings_line: 3, numbers_line: 5 };
    let content = b"\xef\xbb\xbfan open \" quote\r\n\r\nt;p;\xb0C;\r\ns;bar;C;\r\n0,0;1,5;-2e-3;\r\n0,1;2;3,25\r\n";
    let columns = [TIME, NUMBER, FREE, SKIP];
    let table = read_as(content, layout.clone(), &columns).unwrap();
    assert_eq!(numbers(&table.columns[0]), [0.0, 0.1]);
    assert_eq!(numbers(&table.columns[1]), [1.5, 2.0]);
    assert_eq!(numbers(&table.columns[2]), [-2e-3, 3.25]);
    let reader = TableReader::open_as(&Temporary::new(content).0, layout.clone()).unwrap();
    assert_eq!(reader.headings(), ["t", "p", "\u{b0}C", ""]);
    let wrong = |text: &[u8]| read_as(&[content, text].concat(), layout.clone(), &columns).unwrap_err().to_string();
    assert!(wrong(b"0,2;1.234,5;1;\r\n0,3;1;1;\r\n").starts_with("line 7, column 'p': found \"1.234,5\""));
    assert!(wrong(b"0,2\n0,3;1;1\n").starts_with("line 7: found 1 field; the headings have 4"));
    assert!(wrong(b"0,2;1;1;;5\n0,3;1;1\n").starts_with("line 7: found 5 fields"));
    assert!(wrong(b"0,05;1;1").starts_with("line 7, column 't': time runs backwards"));
}

#[test]
fn empty_lines_around_lines_of_text_take_no_numbers_with_them() {
    let columns = [TIME, NUMBER];
    for (content, numbers_line) in [
        (&b"a\nt;p\n\n\n0;1\n1;2\n"[..], 3),
        (b"a\nt;p\n\ns;bar\n\n0;1\n1;2\n", 5),
        (b"a\nt;p\ns;bar\n\nx;y\n0;1\n1;2\n", 6),
    ] {
        let layout = Layout { separator: b';', decimal_comma: false, headings_line: 2, numbers_line };
        assert_eq!(numbers(&read_as(content, layout, &columns).unwrap().columns[0]), [0.0, 1.0]);
    }
}

#[test]
fn headings_beyond_the_end_are_an_error() {
    let layout = Layout { headings_line: 9, numbers_line: 10, ..Layout::default() };
    assert!(matches!(read_as(b"t\n1\n", layout, &[]).unwrap_err().fault, Fault::NoRows));
}
