//! The lock of a data directory: one program at a time uses the store in it.

use crate::store::error::StoreError;
use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind};
use std::path::Path;

/// Locked by the server that uses the directory.
pub(crate) const LOCK_NAME: &str = "lock";

/// Keeps others from using a store in a directory until it is dropped.
#[derive(Debug)]
pub(crate) struct DirectoryLock(File);

impl DirectoryLock {
    /// Makes `dir` if it is absent, and keeps others from using a store in it.
    ///
    /// # Errors
    /// [`StoreError::InUse`], [`StoreError::Open`].
    pub(crate) fn take(dir: &Path) -> Result<Self, StoreError> {
        let failed = |error: io::Error| StoreError::Open { dir: dir.to_owned(), reason: error.to_string() };
        std::fs::create_dir_all(dir).map_err(failed)?;
        let name = dir.join(LOCK_NAME);
        // On a disk that takes nothing the lock of an earlier server will do, or the directory,
        // where nobody has left one.
        let lock = File::create(&name).or_else(|error| match error.kind() {
            ErrorKind::ReadOnlyFilesystem => File::open(&name).or_else(|_| File::open(dir)).map_err(|_| error),
            _ => File::open(&name).map_err(|_| error),
        });
        let lock = lock.map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => Ok(Self(lock)),
            Err(TryLockError::WouldBlock) => Err(StoreError::InUse { dir: dir.to_owned() }),
            Err(TryLockError::Error(error)) => Err(failed(error)),
        }
    }

    /// Whether somebody uses the store in `dir`. Nothing is written: the disk may be full, or
    /// mounted for reading.
    pub(crate) fn is_taken(dir: &Path) -> bool {
        let Ok(lock) = File::open(dir.join(LOCK_NAME)) else { return false };
        let tried = lock.try_lock_shared();
        if tried.is_ok() {
            drop(Self(lock));
        }
        matches!(tried, Err(TryLockError::WouldBlock))
    }
}

impl Drop for DirectoryLock {
    fn drop(&mut self) {
        // To close the file would not do: a program that is just being started has a copy of it.
        if let Err(error) = self.0.unlock() {
            tracing::debug!("the lock of the directory stays until the program ends: {error}");
        }
    }
}
