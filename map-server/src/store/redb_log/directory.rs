//! The store in a data directory: locked, made if it is absent, or checked.

use crate::store::error::StoreError;
use crate::store::redb_log::RedbLog;
use crate::store::redb_log::directory_lock::{DirectoryLock, LOCK_NAME};
use crate::store::redb_log::open_store::{FILE_NAME, FileOnDisk};
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::PoisonError;

/// The file while it is being made.
const UNFINISHED_NAME: &str = "maps.redb.new";

impl RedbLog {
    /// Opens the store in `dir`, making both if absent. A file left by a crash is repaired here,
    /// and an older layout is brought up to date. On a disk that takes nothing a store that is
    /// there is opened all the same, with a [`fault`](crate::store::IncrementLog::fault).
    ///
    /// # Errors
    /// [`StoreError::InUse`], [`StoreError::Open`], [`StoreError::Format`], [`StoreError::Disk`],
    /// [`StoreError::Empty`], [`StoreError::Broken`].
    pub fn open(dir: &Path) -> Result<Self, StoreError> {
        let failed = |error: io::Error| StoreError::Open { dir: dir.to_owned(), reason: error.to_string() };
        let lock = DirectoryLock::take(dir)?;
        let path = dir.join(FILE_NAME);
        if !path.try_exists().map_err(failed)? {
            // Made under another name: a server that is killed meanwhile leaves nothing that the
            // next one could take for a store.
            let unfinished = dir.join(UNFINISHED_NAME);
            match std::fs::remove_file(&unfinished) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(error)),
                _ => {}
            }
            if let Some(reason) = Self::on_disk(Box::new(FileOnDisk::to_be_made(unfinished.clone())))?.opened().fault()
            {
                return Err(StoreError::Open { dir: dir.to_owned(), reason });
            }
            std::fs::rename(&unfinished, &path).map_err(failed)?;
        }
        let mut log = Self::open_file(path)?;
        log.lock = Some(lock);
        // The file's name must survive a power failure, too.
        if let Err(error) = File::open(dir).and_then(|dir| dir.sync_all()) {
            log.opened().note_fault(&error.to_string());
        }
        Ok(log)
    }

    /// Takes away a directory that [`DirectoryLock::take`] has made, if nothing has come into it.
    pub(crate) fn unmake(dir: &Path) {
        // What does not go does no harm.
        let _ = std::fs::remove_file(dir.join(LOCK_NAME));
        let _ = std::fs::remove_dir(dir);
    }

    /// Opens the store in `dir`, which must be there, and checks the sums of all that is in it:
    /// whether they hold, or did not and the file was mended. Nobody else may use it meanwhile.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub(crate) fn open_checked(dir: &Path) -> Result<(Self, bool), StoreError> {
        let path = dir.join(FILE_NAME);
        let mut log = Self::open_file(path.clone())?;
        let broken = |reason: String| StoreError::Broken { file: path.clone(), reason };
        let open = log.open.get_mut().unwrap_or_else(PoisonError::into_inner);
        let is_clean = open.check_sums().map_err(broken)?.unwrap_or(true);
        Ok((log, is_clean))
    }

    fn open_file(path: PathBuf) -> Result<Self, StoreError> {
        if path.metadata().is_ok_and(|file| file.len() == 0) {
            return Err(StoreError::Empty { file: path });
        }
        Self::on_disk(Box::new(FileOnDisk::existing(path)))
    }
}
