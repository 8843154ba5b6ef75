//! How much the chunks of a bag may unpack to.
//!
//! A chunk states its packed and its unpacked size at its beginning, and readers unpack no more
//! than it states. So a look at these numbers, as the file passes by, bounds what a small file can
//! cost, whatever it is packed with.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What every bag may unpack to, bytes.
const FREE: u64 = 64 << 20;
/// How many times its packed size a bag may unpack to beyond that. Scans and pictures of real
/// sensors are below 20.
const RATIO: u64 = 200;
/// Longest name of a compression; MCAP has `zstd` and `lz4`.
const NAME_LIMIT: u32 = 64;

const MAGIC_BYTES: u64 = mcap::MAGIC.len() as u64;
/// Kind and length of a record.
const RECORD_HEAD: usize = 9;
/// A chunk's record up to the length of the compression's name: times, unpacked size, checksum.
const CHUNK_FIXED: usize = RECORD_HEAD + 32;
/// Where the unpacked size is.
const UNPACKED_AT: usize = RECORD_HEAD + 16;
/// Where the length of the compression's name is.
const NAME_LENGTH_AT: usize = RECORD_HEAD + 28;

/// What the chunks of a bag hold so far, by their own account.
#[derive(Debug, Default)]
pub(super) struct Unpacked {
    packed: AtomicU64,
    unpacked: AtomicU64,
}

impl Unpacked {
    /// Whether a bag with one more chunk is as it should be.
    fn admits(&self, packed: u64, unpacked: u64) -> bool {
        let add = |counter: &AtomicU64, bytes: u64| counter.fetch_add(bytes, Ordering::Relaxed).saturating_add(bytes);
        let (packed, unpacked) = (add(&self.packed, packed), add(&self.unpacked, unpacked));
        unpacked <= FREE.saturating_add(packed.saturating_mul(RATIO))
    }
}

/// A file that is read, and fails where it would unpack to too much.
pub(super) struct Guarded<R> {
    inner: R,
    file_bytes: u64,
    largest_chunk: u64,
    bag: Arc<Unpacked>,
    /// The beginning of the current record, as far as it is needed.
    head: Vec<u8>,
    /// Bytes until the next record.
    skip: u64,
}

impl<R> Guarded<R> {
    /// Guards a file of `file_bytes` bytes of a bag. No chunk may unpack to more than
    /// `largest_chunk` bytes.
    pub(super) fn new(inner: R, file_bytes: u64, largest_chunk: u64, bag: Arc<Unpacked>) -> Self {
        Self { inner, file_bytes, largest_chunk, bag, head: Vec::new(), skip: MAGIC_BYTES }
    }

    fn look(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            let skipped = self.skip.min(bytes.len() as u64);
            self.skip -= skipped;
            bytes = &bytes[skipped as usize..];
            let taken = self.missing()?.min(bytes.len());
            self.head.extend_from_slice(&bytes[..taken]);
            bytes = &bytes[taken..];
            if !self.head.is_empty() && self.missing()? == 0 {
                self.judge()?;
            }
        }
        Ok(())
    }

    fn is_chunk(&self) -> bool {
        self.head.first() == Some(&mcap::records::op::CHUNK)
    }

    /// How many bytes of the current record's beginning are still needed.
    fn missing(&self) -> io::Result<usize> {
        let needed = if self.head.len() < RECORD_HEAD || !self.is_chunk() {
            RECORD_HEAD
        } else if self.head.len() < CHUNK_FIXED {
            CHUNK_FIXED
        } else {
            let name = u32::from_le_bytes(self.bytes(NAME_LENGTH_AT));
            if name > NAME_LIMIT {
                return Err(invalid(format!("a chunk names its compression in {name} bytes")));
            }
            CHUNK_FIXED + name as usize + size_of::<u64>()
        };
        Ok(needed - self.head.len())
    }

    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.head[at..at + N]);
        bytes
    }

    /// The beginning of the current record is there.
    fn judge(&mut self) -> io::Result<()> {
        let length = u64::from_le_bytes(self.bytes(1));
        if self.is_chunk() {
            let unpacked = u64::from_le_bytes(self.bytes(UNPACKED_AT));
            let packed = u64::from_le_bytes(self.bytes(self.head.len() - size_of::<u64>()));
            // What is not there unpacks to nothing.
            let packed = packed.min(length).min(self.file_bytes);
            let is_compressed = self.head.len() > CHUNK_FIXED + size_of::<u64>();
            let is_sound = unpacked <= self.largest_chunk && self.bag.admits(packed, unpacked);
            if is_compressed && !is_sound {
                return Err(invalid(format!(
                    "a chunk of {packed} bytes unpacks to {unpacked}: the bag would unpack to more than {FREE} bytes and \
                     {RATIO} times its size, or a chunk to more than {} bytes; if it is meant to, store it without \
                     compression ('ros2 bag convert')",
                    self.largest_chunk
                )));
            }
        }
        self.skip = length.saturating_sub((self.head.len() - RECORD_HEAD) as u64);
        self.head.clear();
        Ok(())
    }
}

fn invalid(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason)
}

impl<R: Read> Read for Guarded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(buffer)?;
        self.look(&buffer[..read])?;
        Ok(read)
    }
}
