//! The bytes of a store on a disk that may fail. From the first write that fails on, what is
//! written stays in memory: the store can be read as before, and nothing more gets to the disk.
//! Whoever writes asks the [`Fault`] afterwards whether what it has written is durable.

use crate::store::redb_log::file_mark::is_displacement;
use redb::{BackendError, StorageBackend};
use std::collections::BTreeMap;
use std::io;
use std::ops::Bound;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

/// What is kept in memory is kept in pieces of this length, bytes.
const PAGE: u64 = 4096;

/// Why a disk cannot be used any more.
#[derive(Debug, Default)]
pub(super) struct Fault(Mutex<Option<FaultReason>>);

/// What has failed, and how.
#[derive(Clone, Debug)]
pub(super) struct FaultReason {
    /// What the system says.
    pub(super) reason: String,
    /// Whether what was written before may have got lost in the system's memory: the disk failed
    /// when it was told to bring it to safety.
    pub(super) is_unsynced: bool,
}

impl Fault {
    /// Notes the first failure.
    pub(super) fn note(&self, reason: &str, is_unsynced: bool) {
        let mut noted = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        noted.get_or_insert_with(|| FaultReason { reason: reason.to_owned(), is_unsynced });
    }

    /// Says otherwise why the disk cannot be used.
    pub(super) fn renew(&self, reason: &str) {
        let mut noted = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(noted) = &mut *noted {
            reason.clone_into(&mut noted.reason);
        }
    }

    /// What has failed, if anything has.
    pub(super) fn get(&self) -> Option<FaultReason> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// What was written after the disk failed.
#[derive(Debug)]
struct Unwritten {
    pages: BTreeMap<u64, Vec<u8>>,
    length: u64,
    /// So much of the file counts, bytes.
    of_file: u64,
}

impl Unwritten {
    /// A page as it is now.
    fn page(&self, number: u64, file: &dyn StorageBackend) -> io::Result<Vec<u8>> {
        if let Some(page) = self.pages.get(&number) {
            return Ok(page.clone());
        }
        let (begin, mut page) = (number * PAGE, vec![0; to_usize(PAGE)]);
        let there = self.of_file.saturating_sub(begin).min(PAGE);
        if there > 0 {
            file.read(begin, &mut page[..to_usize(there)])?;
        }
        Ok(page)
    }

    fn read(&self, offset: u64, out: &mut [u8], file: &dyn StorageBackend) -> io::Result<()> {
        if offset.saturating_add(out.len() as u64) > self.length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        for part in parts(offset, out.len()) {
            let page = self.page(part.page, file)?;
            out[part.at..part.at + part.length].copy_from_slice(&page[part.within..part.within + part.length]);
        }
        Ok(())
    }

    fn write(&mut self, offset: u64, data: &[u8], file: &dyn StorageBackend) -> io::Result<()> {
        for part in parts(offset, data.len()) {
            let mut page = self.page(part.page, file)?;
            page[part.within..part.within + part.length].copy_from_slice(&data[part.at..part.at + part.length]);
            self.pages.insert(part.page, page);
        }
        self.length = self.length.max(offset.saturating_add(data.len() as u64));
        Ok(())
    }

    fn set_length(&mut self, length: u64) {
        if length < self.length {
            self.of_file = self.of_file.min(length);
            self.pages.split_off(&length.div_ceil(PAGE));
            if let Some(page) = self.pages.get_mut(&(length / PAGE)) {
                page[to_usize(length % PAGE)..].fill(0);
            }
        }
        self.length = length;
    }
}

/// A part of a range that lies within one page.
struct Part {
    page: u64,
    /// Where it begins in the page.
    within: usize,
    /// Where it begins in the range.
    at: usize,
    length: usize,
}

fn parts(offset: u64, length: usize) -> impl Iterator<Item = Part> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let position = offset + at as u64;
        let within = to_usize(position % PAGE);
        let part = Part { page: position / PAGE, within, at, length: (length - at).min(to_usize(PAGE) - within) };
        at += part.length;
        (part.length > 0).then_some(part)
    })
}

/// Of lengths within a page.
fn to_usize(length: u64) -> usize {
    usize::try_from(length).unwrap_or(usize::MAX)
}

/// The bytes of a store, which can be written whatever the disk does.
#[derive(Debug)]
pub(super) struct SteadyFile {
    file: Arc<dyn StorageBackend>,
    fault: Arc<Fault>,
    /// None while the disk works.
    unwritten: RwLock<Option<Unwritten>>,
}

impl SteadyFile {
    /// Over a file that works as far as anybody knows, or not, if `fault` says so.
    pub(super) fn new(file: Arc<dyn StorageBackend>, fault: Arc<Fault>) -> io::Result<Self> {
        let steady = Self { file, fault, unwritten: RwLock::default() };
        if steady.fault.get().is_some() {
            steady.in_memory(|_, _| Ok(()))?;
        }
        Ok(steady)
    }

    /// Does in memory what the disk does not.
    fn in_memory(
        &self,
        change: impl FnOnce(&mut Unwritten, &dyn StorageBackend) -> io::Result<()>,
    ) -> Result<(), io::Error> {
        let mut unwritten = self.unwritten.write().unwrap_or_else(PoisonError::into_inner);
        let unwritten = match &mut *unwritten {
            Some(unwritten) => unwritten,
            none => {
                let length = self.file.len()?;
                none.insert(Unwritten { pages: BTreeMap::new(), length, of_file: length })
            }
        };
        change(unwritten, self.file.as_ref())
    }

    /// On the disk if it works, else in memory.
    fn change(
        &self,
        on_disk: impl FnOnce(&dyn StorageBackend) -> io::Result<()>,
        is_sync: bool,
        in_memory: impl FnOnce(&mut Unwritten, &dyn StorageBackend) -> io::Result<()>,
    ) -> io::Result<()> {
        let unwritten = self.unwritten.read().unwrap_or_else(PoisonError::into_inner);
        if unwritten.is_none() {
            match on_disk(self.file.as_ref()) {
                Ok(()) => return Ok(()),
                // A file that has lost its name has lost nothing else.
                Err(error) => self.fault.note(&error.to_string(), is_sync && !is_displacement(&error)),
            }
        }
        drop(unwritten);
        self.in_memory(in_memory)
    }
}

impl StorageBackend for SteadyFile {
    fn len(&self) -> io::Result<u64> {
        let unwritten = self.unwritten.read().unwrap_or_else(PoisonError::into_inner);
        unwritten.as_ref().map_or_else(|| self.file.len(), |unwritten| Ok(unwritten.length))
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let unwritten = self.unwritten.read().unwrap_or_else(PoisonError::into_inner);
        match &*unwritten {
            None => self.file.read(offset, out),
            Some(unwritten) => unwritten.read(offset, out, self.file.as_ref()),
        }
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        let in_memory = |unwritten: &mut Unwritten, _: &dyn StorageBackend| {
            unwritten.set_length(len);
            Ok(())
        };
        self.change(|file| file.set_len(len), false, in_memory)
    }

    fn sync_data(&self) -> io::Result<()> {
        let on_disk = |file: &dyn StorageBackend| {
            file.sync_data()?;
            Ok(())
        };
        self.change(on_disk, true, |_, _| Ok(()))
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.change(|file| file.write(offset, data), false, |unwritten, file| unwritten.write(offset, data, file))
    }

    fn close(&self) -> io::Result<()> {
        self.file.close()
    }

    fn try_lock_range(&self, start: Bound<u64>, end: Bound<u64>) -> Result<bool, BackendError> {
        self.file.try_lock_range(start, end)
    }

    fn try_lock_shared_range(&self, start: Bound<u64>, end: Bound<u64>) -> Result<bool, BackendError> {
        self.file.try_lock_shared_range(start, end)
    }

    fn lock_range(&self, start: Bound<u64>, end: Bound<u64>) -> Result<(), BackendError> {
        self.file.lock_range(start, end)
    }

    fn lock_shared_range(&self, start: Bound<u64>, end: Bound<u64>) -> Result<(), BackendError> {
        self.file.lock_shared_range(start, end)
    }

    fn unlock_range(&self, start: Bound<u64>, end: Bound<u64>) -> Result<(), BackendError> {
        self.file.unlock_range(start, end)
    }

    fn query_lock_range(&self, start: Bound<u64>, end: Bound<u64>) -> Result<bool, BackendError> {
        self.file.query_lock_range(start, end)
    }
}
