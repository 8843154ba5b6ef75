//! Messages of a bag, one after another, as far as the files can be read.

use super::files::{BagOpenError, files_of};
use super::unpacking::{Guarded, Unpacked};
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Longest record and largest chunk that are read, bytes. This limits what a corrupt length can
/// cost.
pub(crate) const RECORD_LIMIT: usize = 256 << 20;

/// A file that could not be read to the end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Broken {
    /// The file.
    pub file: PathBuf,
    /// About how many bytes of it could be read.
    pub byte: u64,
    /// When the last message before the damage was logged, nanoseconds since the epoch; `None` if
    /// there was none.
    pub last_log_ns: Option<u64>,
    /// What is wrong.
    pub reason: String,
}

impl std::fmt::Display for Broken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { file, byte, last_log_ns, reason } = self;
        write!(f, "{} can be read up to byte {byte}", file.display())?;
        if let Some(time) = last_log_ns {
            write!(f, " (time {:.3} s)", *time as f64 * 1e-9)?;
        }
        write!(f, ": {reason}")
    }
}

/// Why reading stopped, as text.
pub(crate) fn reason(error: &mcap::McapError) -> String {
    match error {
        mcap::McapError::UnexpectedEof => {
            "it ends in the middle of a record; was it cut, or its recording killed?".to_owned()
        }
        mcap::McapError::Io(error) => error.to_string(),
        other => other.to_string(),
    }
}

/// Counts the bytes read.
struct Counting<R> {
    inner: R,
    bytes: Arc<AtomicU64>,
}

impl<R: Read> Read for Counting<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let read = self.inner.read(buffer)?;
        self.bytes.fetch_add(read as u64, Ordering::Relaxed);
        Ok(read)
    }
}

struct OpenFile {
    path: PathBuf,
    reader: MessageReader<Guarded<Counting<BufReader<File>>>>,
    /// Bytes read from the files before.
    begin: u64,
    last_log_ns: Option<u64>,
}

/// The messages of a bag in the order in which they were logged. Memory does not grow with the
/// files: it holds one chunk. A chunk whose checksum fails is not used. Damage ends its file, and
/// reading continues with the next one; so does a chunk with which the bag would unpack to more
/// than 200 times its size (and 64 MiB). What follows the end of a recording in its file is not
/// read, and told.
pub struct Messages {
    files: VecDeque<PathBuf>,
    open: Option<OpenFile>,
    bytes: Arc<AtomicU64>,
    unpacked: Arc<Unpacked>,
    total_bytes: u64,
    broken: Vec<Broken>,
}

impl Messages {
    /// Opens the bag at `path`: an MCAP file, a rosbag2 folder or a folder of MCAP files.
    ///
    /// # Errors
    /// [`BagOpenError`] when there is no bag. Files that are damaged further on are read up to the
    /// damage.
    pub fn open(path: &Path) -> Result<Self, BagOpenError> {
        Ok(Self::of_files(files_of(path)?))
    }

    pub(crate) fn of_files(files: Vec<PathBuf>) -> Self {
        let total_bytes = files.iter().map(|path| file_bytes(path)).sum();
        let bytes = Arc::new(AtomicU64::new(0));
        let unpacked = Arc::default();
        Self { files: files.into(), open: None, bytes, unpacked, total_bytes, broken: Vec::new() }
    }

    /// The files that could not be read to the end, so far.
    #[must_use]
    pub fn broken(&self) -> &[Broken] {
        &self.broken
    }

    /// Bytes read so far and bytes of all files.
    #[must_use]
    pub fn progress(&self) -> (u64, u64) {
        (self.bytes.load(Ordering::Relaxed), self.total_bytes)
    }

    /// Opens the next file; `false` after the last.
    fn advance(&mut self) -> bool {
        let Some(path) = self.files.pop_front() else { return false };
        let options =
            LinearReaderOptions::default().with_prevalidate_chunk_crcs(true).with_record_length_limit(RECORD_LIMIT);
        let begin = self.bytes.load(Ordering::Relaxed);
        match File::open(&path) {
            Ok(file) => {
                let source = Counting { inner: BufReader::with_capacity(1 << 16, file), bytes: self.bytes.clone() };
                let size = file_bytes(&path);
                let source = Guarded::new(source, size, RECORD_LIMIT as u64, Arc::clone(&self.unpacked));
                let reader = MessageReader::new_with_options(source, options);
                self.open = Some(OpenFile { path, reader, begin, last_log_ns: None });
            }
            Err(error) => {
                self.broken.push(Broken { file: path, byte: 0, last_log_ns: None, reason: error.to_string() });
            }
        }
        true
    }

    /// Closes the file that is open; `damage` says why it could not be read to its end.
    fn end_file(&mut self, damage: Option<String>) {
        let Some(OpenFile { path, begin, last_log_ns, .. }) = self.open.take() else { return };
        let byte = self.bytes.load(Ordering::Relaxed) - begin;
        // A recording says itself where it ends.
        let beyond = || match file_bytes(&path).saturating_sub(byte) {
            0 => None,
            left => Some(format!(
                "{left} bytes follow the end of the recording there; was another put behind it? ('mcap merge' makes \
                 one of both)"
            )),
        };
        if let Some(reason) = damage.or_else(beyond) {
            self.broken.push(Broken { file: path, byte, last_log_ns, reason });
        }
    }
}

fn file_bytes(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |about| about.len())
}

impl Iterator for Messages {
    type Item = mcap::Message<'static>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let Some(file) = &mut self.open else {
                if self.advance() {
                    continue;
                }
                return None;
            };
            match file.reader.next() {
                Some(Ok(message)) => {
                    file.last_log_ns = Some(message.log_time);
                    return Some(message);
                }
                Some(Err(error)) => self.end_file(Some(reason(&error))),
                None => self.end_file(None),
            }
        }
    }
}
