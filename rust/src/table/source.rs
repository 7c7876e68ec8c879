//! Opens a file of text, unpacks it if it is gzip, and keeps count of what has been read.

use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use flate2::read::MultiGzDecoder;

use super::error::{Fault, LineTooLong, Unpacking};

/// No line of a table of numbers is longer; more without a line end is a runaway quote or not a table.
const LONGEST_LINE: u64 = 16 << 20;
/// What is looked at to tell text from other kinds of files.
const PROBE: usize = 8192;
/// Lines of the beginning that are kept, and characters of each: enough to find headings below a preamble.
const OPENING: (usize, usize) = (30, 400);

/// A number that two owners in one thread share. Atomic only so that a reader may be moved to another thread.
#[derive(Default)]
pub(super) struct Count(AtomicU64);

impl Count {
    pub fn get(&self) -> u64 {
        self.0.load(Relaxed)
    }

    pub fn set(&self, value: u64) {
        self.0.store(value, Relaxed);
    }
}

/// Counts shared between the reading end and whoever parses.
#[derive(Default)]
pub(super) struct Counts {
    /// Bytes read from the file on disk.
    pub on_disk: Count,
    /// Bytes of text handed out.
    pub text: Count,
    /// Where in the text the line begins that is being parsed.
    pub line_start: Count,
    /// Last byte of text handed out.
    pub last: Count,
}

/// An open file of text.
pub(super) struct Source {
    pub text: Box<dyn Read + Send>,
    pub counts: Arc<Counts>,
    pub unpacking: Unpacking,
    /// Size of the file on disk, bytes.
    pub size: u64,
    /// The first lines of text, clipped.
    pub opening: Vec<String>,
}

/// Open a file; what it is, is decided by its first bytes, not by its name.
pub(super) fn open(path: &Path) -> Result<Source, Fault> {
    let file = File::open(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => Fault::Missing,
        io::ErrorKind::IsADirectory => Fault::NotAFile,
        _ => Fault::Io(error),
    })?;
    let about = file.metadata().map_err(Fault::Io)?;
    if about.is_dir() {
        return Err(Fault::NotAFile);
    }
    let counts = Arc::new(Counts::default());
    let mut disk = OnDisk { file, counts: Arc::clone(&counts) };
    let start = probe(&mut disk).map_err(Fault::Io)?;
    let unpacking = if start.starts_with(&[0x1f, 0x8b]) { Unpacking::Gzip } else { Unpacking::Plain };
    let whole = Cursor::new(start).chain(disk);
    let mut text: Box<dyn Read + Send> = match unpacking {
        Unpacking::Plain => Box::new(whole),
        Unpacking::Gzip => Box::new(MultiGzDecoder::new(whole)),
    };
    let start = probe(&mut text).map_err(|error| Fault::from_io(error, unpacking))?;
    refuse_other_kinds(&start)?;
    let opening = opening(&start);
    let text = Text { inner: Cursor::new(start).chain(text), counts: Arc::clone(&counts), after_return: false };
    Ok(Source { text: Box::new(text), counts, unpacking, size: about.len(), opening })
}

/// The same text after so many lines, and how many bytes these have; they may hold anything, open quotes too.
pub(super) fn after_lines(mut text: Box<dyn Read + Send>, lines: u64) -> io::Result<(Box<dyn Read + Send>, u64)> {
    let (mut left, mut bytes) = (lines, 0);
    let mut buffer = vec![0; PROBE];
    while left > 0 {
        let count = text.read(&mut buffer)?;
        if count == 0 {
            break;
        }
        for (place, byte) in buffer[..count].iter().enumerate() {
            left -= u64::from(*byte == b'\n');
            if left == 0 {
                let rest = Cursor::new(buffer[place + 1..count].to_vec());
                return Ok((Box::new(rest.chain(text)), bytes + place as u64 + 1));
            }
        }
        bytes += count as u64;
    }
    Ok((text, bytes))
}

fn opening(start: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(start).replace("\r\n", "\n");
    let lines = text.strip_prefix('\u{feff}').unwrap_or(&text).split(['\n', '\r']);
    lines.take(OPENING.0).map(|line| line.chars().take(OPENING.1).collect()).collect()
}

fn probe(reader: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut start = Vec::with_capacity(PROBE);
    reader.take(PROBE as u64).read_to_end(&mut start)?;
    Ok(start)
}

fn refuse_other_kinds(start: &[u8]) -> Result<(), Fault> {
    const UNPACK: &str = "unpack it";
    const SAVE: &str = "save it as UTF-8";
    const KINDS: [(&[u8], &str, &str); 9] = [
        (b"PAR1", "a Parquet file", "it is read by its own headings"),
        (b"PK\x03\x04", "a zip archive or a spreadsheet (.xlsx)", "unpack it, or save the sheet as CSV"),
        (b"\x89HDF", "an HDF5 or MATLAB 7.3 file", "it is read by a mapping file"),
        (b"MATLAB", "a MATLAB file", "it is read by a mapping file"),
        (b"\x28\xb5\x2f\xfd", "packed with zstd", UNPACK),
        (b"\xfd7zXZ", "packed with xz", UNPACK),
        (b"BZh", "packed with bzip2", UNPACK),
        (b"\xff\xfe", "UTF-16 text", SAVE),
        (b"\xfe\xff", "UTF-16 text", SAVE),
    ];
    if let Some((_, kind, advice)) = KINDS.iter().find(|(magic, _, _)| start.starts_with(magic)) {
        return Err(Fault::Binary(kind, advice));
    }
    if start.contains(&0) {
        return Err(Fault::Binary("binary data", "is it the right file?"));
    }
    if start.iter().all(u8::is_ascii_whitespace) {
        return Err(Fault::Empty);
    }
    Ok(())
}

struct OnDisk {
    file: File,
    counts: Arc<Counts>,
}

impl Read for OnDisk {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.counts.on_disk.set(self.counts.on_disk.get() + count as u64);
        Ok(count)
    }
}

/// Text whose lines end with "\n", whatever they end with in the file: "\n", "\r\n" or "\r", also mixed.
struct Text<R> {
    inner: R,
    counts: Arc<Counts>,
    /// Whether the last byte read was "\r", so that a "\n" after it belongs to the same line end.
    after_return: bool,
}

impl<R> Text<R> {
    /// Make every line end "\n", in place; returns how many bytes are left.
    fn with_plain_line_ends(&mut self, bytes: &mut [u8]) -> usize {
        if !self.after_return && !bytes.contains(&b'\r') {
            return bytes.len();
        }
        let mut kept = 0;
        for index in 0..bytes.len() {
            let byte = bytes[index];
            if byte == b'\n' && self.after_return {
                self.after_return = false;
                continue;
            }
            self.after_return = byte == b'\r';
            bytes[kept] = if self.after_return { b'\n' } else { byte };
            kept += 1;
        }
        kept
    }
}

impl<R: Read> Read for Text<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.counts.text.get() - self.counts.line_start.get() > LONGEST_LINE {
            return Err(io::Error::other(LineTooLong));
        }
        let count = loop {
            let read = self.inner.read(buffer)?;
            let count = self.with_plain_line_ends(&mut buffer[..read]);
            // Nothing means the end, so the rest of a line end alone must not be nothing.
            if count > 0 || read == 0 {
                break count;
            }
        };
        self.counts.text.set(self.counts.text.get() + count as u64);
        if count > 0 {
            self.counts.last.set(buffer[count - 1].into());
        }
        Ok(count)
    }
}
