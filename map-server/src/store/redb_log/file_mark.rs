//! Whether the file under a store's name is still the one that is open, as this program left it.
//! Somebody may move or remove it, cut it off, or put another in its place. The system goes on
//! taking what is written into a file without a name, and a restart finds nothing of it.
//!
//! What this program has written is known exactly, for everything that it writes goes through
//! [`MarkedFile`]. Of the content the first page is compared: it names every commit, with the sums
//! of what the commit has put elsewhere.

use redb::{BackendError, StorageBackend};
use std::fs::{File, Metadata};
use std::io::{self, ErrorKind};
use std::ops::Bound;
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// So much of the file says which commits it has, bytes.
const FIRST_PAGE: u64 = 4096;

/// What has become of a store's file.
#[derive(Debug, thiserror::Error)]
pub(super) enum Displacement {
    /// Nothing has its name.
    #[error("{} was moved or removed: put it back", file.display())]
    Gone {
        /// The file.
        file: PathBuf,
    },
    /// Another file has its name.
    #[error("{} was replaced by something else: put back the store that was there", file.display())]
    Replaced {
        /// The file.
        file: PathBuf,
    },
    /// It is shorter.
    #[error("{} was truncated to {length} of {left} bytes: put back the store that was there", file.display())]
    Truncated {
        /// The file.
        file: PathBuf,
        /// Its length, bytes.
        length: u64,
        /// What its length was, bytes.
        left: u64,
    },
    /// Another program has written into it.
    #[error("{} was changed by something else than this server: put back the store that was there", file.display())]
    Changed {
        /// The file.
        file: PathBuf,
    },
    /// The system does not say.
    #[error("{} cannot be looked at: {source}", file.display())]
    Unknown {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// Whether an error of a [`MarkedFile`] says that the file is not the one under its name.
pub(super) fn is_displacement(error: &io::Error) -> bool {
    matches!(error.get_ref(), Some(inner) if inner.is::<Displacement>())
}

/// A file as it was left.
#[derive(Clone, Debug)]
struct Left {
    /// Device and inode of the file that is open.
    identity: (u64, u64),
    /// Bytes.
    length: u64,
    /// None: the disk failed, and nobody knows what it has.
    first_page: Option<Vec<u8>>,
}

impl Left {
    /// The first page is no longer than the file.
    fn keep_first_page_within(&mut self) {
        if let Some(page) = &mut self.first_page {
            page.resize(within_first_page(self.length), 0);
        }
    }
}

/// A store's file: its name, and what was left there. Clones are the same mark.
#[derive(Clone, Debug)]
pub(super) struct FileMark {
    path: PathBuf,
    /// None: it was not opened yet.
    left: Arc<Mutex<Option<Left>>>,
}

impl FileMark {
    /// Of a file that was not opened yet.
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, left: Arc::default() }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file was opened before.
    pub(super) fn is_known(&self) -> bool {
        self.left().is_some()
    }

    /// Says that the file which is open is not the one under the name any more, as it was left.
    ///
    /// # Errors
    /// [`Displacement`].
    pub(super) fn check(&self) -> Result<(), Displacement> {
        self.left().as_ref().map_or(Ok(()), |left| self.compare(left, true))
    }

    /// Whether what has the name now may be opened: the file that was left, or a copy of it.
    ///
    /// # Errors
    /// [`Displacement`].
    pub(super) fn check_content(&self) -> Result<(), Displacement> {
        self.left().as_ref().map_or(Ok(()), |left| self.compare(left, left.first_page.is_none()))
    }

    /// Takes a file that was opened just now for the one of this mark.
    ///
    /// # Errors
    /// [`Displacement`]: it is not the one that was left here.
    pub(super) fn adopt(&self, opened: &File) -> Result<(), Displacement> {
        let mut left = self.left();
        let metadata = opened.metadata().map_err(self.unknown())?;
        if let Some(left) = &*left {
            self.compare_opened(left, opened, &metadata, left.first_page.is_none())?;
        }
        let first_page = Some(first_page(opened, metadata.len()).map_err(self.unknown())?);
        *left = Some(Left { identity: identity(&metadata), length: metadata.len(), first_page });
        Ok(())
    }

    fn left(&self) -> MutexGuard<'_, Option<Left>> {
        self.left.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn unknown(&self) -> impl Fn(io::Error) -> Displacement {
        let file = self.path.clone();
        move |source| match source.kind() {
            ErrorKind::NotFound | ErrorKind::NotADirectory => Displacement::Gone { file: file.clone() },
            _ => Displacement::Unknown { file: file.clone(), source },
        }
    }

    fn compare(&self, left: &Left, is_same_file: bool) -> Result<(), Displacement> {
        let metadata = self.path.metadata().map_err(self.unknown())?;
        // Opening what is no file may wait for ever.
        if !metadata.is_file() || (is_same_file && identity(&metadata) != left.identity) {
            return Err(Displacement::Replaced { file: self.path.clone() });
        }
        let file = File::open(&self.path).map_err(self.unknown())?;
        let metadata = file.metadata().map_err(self.unknown())?;
        self.compare_opened(left, &file, &metadata, is_same_file)
    }

    fn compare_opened(
        &self,
        left: &Left,
        file: &File,
        metadata: &Metadata,
        is_same_file: bool,
    ) -> Result<(), Displacement> {
        let path = || self.path.clone();
        let (length, is_same) = (metadata.len(), identity(metadata) == left.identity);
        if is_same_file && !is_same {
            return Err(Displacement::Replaced { file: path() });
        }
        let is_first_page = || match &left.first_page {
            Some(expected) => first_page(file, length).map(|page| page == *expected),
            None => Ok(true),
        };
        if length == left.length && is_first_page().map_err(self.unknown())? {
            return Ok(());
        }
        Err(match is_same {
            false => Displacement::Replaced { file: path() },
            true if length < left.length => Displacement::Truncated { file: path(), length, left: left.length },
            true => Displacement::Changed { file: path() },
        })
    }
}

fn identity(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}

/// A position, or the end of the first page if that comes before.
fn within_first_page(position: u64) -> usize {
    usize::try_from(position.min(FIRST_PAGE)).unwrap_or(0)
}

fn first_page(file: &File, length: u64) -> io::Result<Vec<u8>> {
    let mut page = vec![0; within_first_page(length)];
    file.read_exact_at(&mut page, 0)?;
    Ok(page)
}

/// What a change concerns.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Touched {
    FirstPage,
    Length,
    Rest,
}

/// An open file that takes nothing once it is not the one under its name any more: what is written
/// then would be lost, or would spoil what somebody else has put there.
#[derive(Debug)]
pub(super) struct MarkedFile<F> {
    file: F,
    mark: FileMark,
    /// Nothing was written since the file was last brought to safety: a commit begins.
    is_settled: AtomicBool,
}

impl<F: StorageBackend> MarkedFile<F> {
    /// Over a file that the mark has adopted.
    pub(super) fn new(file: F, mark: FileMark) -> Self {
        Self { file, mark, is_settled: AtomicBool::new(true) }
    }

    /// Changes the file, and notes what was left.
    fn change(
        &self,
        touched: Touched,
        change: impl FnOnce(&F) -> io::Result<()>,
        note: impl FnOnce(&mut Left),
    ) -> io::Result<()> {
        let mut left = self.mark.left();
        let Some(left) = &mut *left else { return change(&self.file) };
        if self.is_settled.swap(false, Ordering::Relaxed) || touched != Touched::Rest {
            self.mark.compare(left, true).map_err(io::Error::other)?;
        }
        let changed = change(&self.file);
        match &changed {
            Ok(()) => note(left),
            Err(_) => {
                left.length = self.file.len().unwrap_or(left.length);
                if touched == Touched::FirstPage {
                    left.first_page = None;
                }
            }
        }
        left.keep_first_page_within();
        changed
    }
}

impl<F: StorageBackend> StorageBackend for MarkedFile<F> {
    fn len(&self) -> io::Result<u64> {
        self.file.len()
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.file.read(offset, out)
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.change(Touched::Length, |file| file.set_len(len), |left| left.length = len)
    }

    fn sync_data(&self) -> io::Result<()> {
        // If that fails, the disk may have forgotten the first page, too.
        self.change(Touched::FirstPage, F::sync_data, |_| ())?;
        self.is_settled.store(true, Ordering::Relaxed);
        // What was written meanwhile counts only if the file has kept its name.
        self.mark.check().map_err(io::Error::other)
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        let end = offset.saturating_add(data.len() as u64);
        let note = |left: &mut Left| {
            left.length = left.length.max(end);
            if let Some(page) = &mut left.first_page
                && offset < FIRST_PAGE
            {
                let (begin, end) = (within_first_page(offset), within_first_page(end));
                page.resize(page.len().max(end), 0);
                page[begin..end].copy_from_slice(&data[..end - begin]);
            }
        };
        let touched = if offset < FIRST_PAGE { Touched::FirstPage } else { Touched::Rest };
        self.change(touched, |file| file.write(offset, data), note)
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
