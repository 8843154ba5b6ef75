//! The open file of a store on a disk that may fail, opened anew after a fault.

use crate::store::error::StoreError;
use crate::store::guard::{damage, guarded};
use crate::store::redb_log::ends;
use crate::store::redb_log::file_mark::{FileMark, MarkedFile};
use crate::store::redb_log::steady_file::{Fault, FaultReason, SteadyFile};
use crate::store::redb_log::tables::{COMPACTED, FLOOR_VERSIONS, FLOORS, INCREMENTS, LOG, META, reading, writing};
use redb::backends::FileBackend;
use redb::{
    Database, DatabaseError, ReadTransaction, ReadableDatabase, StorageBackend, TableDefinition, TableError,
    WriteTransaction,
};
use std::fmt::Debug;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

const FORMAT_KEY: &str = "format";
/// Format 1 had no compacted series.
const FORMAT: u64 = 2;
/// The file in the data directory.
pub const FILE_NAME: &str = "maps.redb";

/// Holds what is written to find out whether the disk takes it.
const PROBE: TableDefinition<'_, u64, &[u8]> = TableDefinition::new("probe");
/// So much must fit before a disk counts as one that works again, bytes.
const PROBE_BYTES: usize = 1 << 20;

/// The disk under a store, opened again after a fault.
pub trait StoreDisk: Debug + Send + Sync {
    /// The store's bytes, and why they cannot be written, if that is known.
    ///
    /// # Errors
    /// When they cannot be read.
    fn open(&self) -> io::Result<(Box<dyn StorageBackend>, Option<String>)>;

    /// Room left, bytes; none: that is not known.
    fn free_bytes(&self) -> Option<u64> {
        None
    }

    /// What has become of the file since it was opened, other than by this server: it has lost its
    /// name, or was changed. None: nothing, as far as anybody knows.
    fn displaced(&self) -> Option<String> {
        None
    }

    /// Why what has the file's name now must not be opened in its place; none: it is what was left
    /// there, or nothing was opened before.
    fn strange(&self) -> Option<String> {
        None
    }

    /// The file, to be named to people.
    fn path(&self) -> &Path;
}

/// A file that is opened for reading alone: its disk takes nothing. The lock of the directory keeps
/// others away.
#[derive(Debug)]
struct ReadOnlyFile(FileBackend);

impl StorageBackend for ReadOnlyFile {
    fn len(&self) -> io::Result<u64> {
        self.0.len()
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.0.read(offset, out)
    }

    fn set_len(&self, _: u64) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn sync_data(&self) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }

    fn write(&self, _: u64, _: &[u8]) -> io::Result<()> {
        Err(ErrorKind::ReadOnlyFilesystem.into())
    }
}

/// A file on a disk of the system.
#[derive(Debug)]
pub(super) struct FileOnDisk {
    mark: FileMark,
    /// It is made if it is absent.
    is_made: bool,
}

impl FileOnDisk {
    /// A file that is there.
    pub(super) fn existing(path: PathBuf) -> Self {
        Self { mark: FileMark::new(path), is_made: false }
    }

    /// A file that is made.
    pub(super) fn to_be_made(path: PathBuf) -> Self {
        Self { is_made: true, ..Self::existing(path) }
    }
}

impl StoreDisk for FileOnDisk {
    fn open(&self) -> io::Result<(Box<dyn StorageBackend>, Option<String>)> {
        let path = self.mark.path();
        let mark = |file: File| {
            self.mark.adopt(&file).map_err(io::Error::other)?;
            FileBackend::new(file).map_err(|error| io::Error::other(error.to_string()))
        };
        // Where a store was, an empty one in its place would hide that it is gone.
        let is_made = self.is_made && !self.mark.is_known();
        match OpenOptions::new().read(true).write(true).create(is_made).truncate(false).open(path) {
            Ok(file) => Ok((Box::new(MarkedFile::new(mark(file)?, self.mark.clone())), None)),
            Err(error) if error.kind() == ErrorKind::ReadOnlyFilesystem => {
                let file = ReadOnlyFile(mark(File::open(path)?)?);
                Ok((Box::new(MarkedFile::new(file, self.mark.clone())), Some(error.to_string())))
            }
            Err(error) => Err(error),
        }
    }

    fn displaced(&self) -> Option<String> {
        self.mark.check().err().map(|displacement| displacement.to_string())
    }

    fn strange(&self) -> Option<String> {
        self.mark.check_content().err().map(|displacement| displacement.to_string())
    }

    fn free_bytes(&self) -> Option<u64> {
        let room = rustix::fs::statvfs(self.mark.path().parent()?).ok()?;
        Some(room.f_bavail.saturating_mul(room.f_frsize))
    }

    fn path(&self) -> &Path {
        self.mark.path()
    }
}

/// An open file and what has become of its disk since.
#[derive(Debug)]
pub(super) struct OpenStore {
    // There until it is closed.
    database: Option<Database>,
    fault: Arc<Fault>,
    file: Arc<dyn StorageBackend>,
    path: Arc<Path>,
    /// A [`Condition`], as a number.
    condition: AtomicU8,
}

/// What is known of the content of a file; it never gets better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Condition {
    Sound,
    /// What was read of it is not what was written.
    Misread,
    /// The storage library has stumbled over it.
    Damaged,
}

impl OpenStore {
    /// The store on a disk, brought to the newest layout.
    pub(super) fn open(disk: &dyn StoreDisk) -> Result<Self, StoreError> {
        let path: Arc<Path> = disk.path().into();
        let dir = path.parent().unwrap_or(&path);
        let broken = |reason: String| StoreError::Broken { file: path.to_path_buf(), reason };
        let failed = |error: io::Error| StoreError::Open { dir: dir.to_owned(), reason: error.to_string() };
        let (file, reason) = disk.open().map_err(failed)?;
        let fault = Arc::new(Fault::default());
        if let Some(reason) = reason {
            fault.note(&reason, false);
        }
        let file: Arc<dyn StorageBackend> = file.into();
        let steady = SteadyFile::new(Arc::clone(&file), Arc::clone(&fault)).map_err(failed)?;
        let opened = guarded(&path, || Database::builder().create_with_backend(steady));
        let database = opened.map_err(|panic| broken(damage(&panic)))?.map_err(|error| match error {
            DatabaseError::DatabaseAlreadyOpen => StoreError::InUse { dir: dir.to_owned() },
            DatabaseError::Storage(redb::StorageError::Corrupted(reason)) => broken(reason),
            DatabaseError::Storage(redb::StorageError::Io(error))
                if matches!(error.kind(), ErrorKind::InvalidData | ErrorKind::UnexpectedEof) =>
            {
                broken(error.to_string())
            }
            other => StoreError::Open { dir: dir.to_owned(), reason: other.to_string() },
        })?;
        let store = Self {
            database: Some(database),
            fault,
            file,
            path: Arc::clone(&path),
            condition: AtomicU8::new(Condition::Sound as u8),
        };
        let made = match store.format().map_err(|error| error.of_file(&path))? {
            Some(FORMAT) => Ok(()),
            // Format 2 only adds tables.
            None | Some(1) => store.write(make_tables),
            Some(found) => return Err(StoreError::Format { dir: dir.to_owned(), found, known: FORMAT }),
        };
        match made.and_then(|()| store.add_ends()) {
            Err(error) if store.fault().is_none() => Err(error),
            _ => Ok(store),
        }
    }

    /// Adds to a store that has none what each author's last increment is, once more. One of which
    /// something does not read goes on without it.
    fn add_ends(&self) -> Result<(), StoreError> {
        match self.read(ends::absent) {
            Ok(None) => Ok(()),
            Ok(Some(lasts)) => self.write(|write| {
                let lasts = lasts.iter().map(|((map, author), last)| ((map.as_str(), *author), *last));
                ends::note(write, lasts)
            }),
            Err(error) => {
                tracing::warn!("how many increments each author has is not noted once more: {error}");
                Ok(())
            }
        }
    }

    /// The format of the file; none in a new one.
    fn format(&self) -> Result<Option<u64>, StoreError> {
        self.read(|read| {
            let meta = match read.open_table(META) {
                Err(TableError::TableDoesNotExist(_)) => return Ok(None),
                other => other.map_err(reading)?,
            };
            Ok(meta.get(FORMAT_KEY).map_err(reading)?.map(|format| format.value()))
        })
    }

    fn database(&self, action: &'static str) -> Result<&Database, StoreError> {
        self.database.as_ref().ok_or_else(|| StoreError::Disk { action, reason: "it is closed".to_owned() })
    }

    pub(super) fn read<T>(
        &self,
        work: impl FnOnce(&ReadTransaction) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let read = guarded(&self.path, || work(&self.database("read")?.begin_read().map_err(reading)?));
        read.unwrap_or_else(|panic| Err(self.damaged("read", &panic)))
    }

    /// Notes that what was read is not what was written.
    pub(super) fn distrust(&self) {
        self.worsen(Condition::Misread);
    }

    fn worsen(&self, condition: Condition) {
        self.condition.fetch_max(condition as u8, Ordering::Relaxed);
    }

    fn is_at_least(&self, condition: Condition) -> bool {
        self.condition.load(Ordering::Relaxed) >= condition as u8
    }

    /// A panic of the storage library, as an error.
    fn damaged(&self, action: &'static str, panic: &str) -> StoreError {
        self.worsen(Condition::Damaged);
        StoreError::Disk { action, reason: damage(panic) }
    }

    /// Does `work` in one commit. On success it is durable.
    pub(super) fn write(
        &self,
        work: impl FnOnce(&WriteTransaction) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        if let Some(reason) = self.fault() {
            return Err(StoreError::ReadOnly { reason });
        }
        let commit = || {
            let mut write = self.database("written")?.begin_write().map_err(writing)?;
            // Commits in two phases and keeps what a repair needs: recovery after a crash takes no
            // longer for a large file, and does not depend on checksums over bytes that strangers
            // chose.
            write.set_quick_repair(true);
            work(&write)?;
            write.commit().map_err(writing)
        };
        let written = guarded(&self.path, commit).unwrap_or_else(|panic| Err(self.damaged("written", &panic)));
        if let Err(error) = &written {
            self.fault.note(&error.to_string(), false);
        }
        // What the disk did not take is in memory alone.
        let failed = |FaultReason { reason, .. }| StoreError::Disk { action: "written", reason };
        written.and_then(|()| self.fault.get().map_or(Ok(()), |fault| Err(failed(fault))))
    }

    /// Notes that nothing can be written.
    pub(super) fn note_fault(&self, reason: &str) {
        self.fault.note(reason, false);
    }

    /// Why nothing can be written.
    pub(super) fn fault(&self) -> Option<String> {
        self.fault.get().map(|fault| fault.reason)
    }

    /// Opens the file anew after a fault, without what the disk did not take, and writes something
    /// to see whether the disk takes it. While something else has the file's name, the file that is
    /// open stays open: it may have no other name, and what is asked is answered from it.
    pub(super) fn reopen(&mut self, disk: &dyn StoreDisk) -> Result<(), StoreError> {
        let Some(fault) = self.fault.get() else { return Ok(()) };
        if let Some(reason) = disk.strange() {
            self.fault.renew(&reason);
            return Err(StoreError::ReadOnly { reason });
        }
        // Nothing heals by itself what is damaged.
        if self.is_at_least(Condition::Damaged) {
            return Err(StoreError::ReadOnly { reason: fault.reason });
        }
        self.close();
        let rewritten = if fault.is_unsynced { rewrite(disk) } else { Ok(()) };
        let opened = Self::open(disk);
        if matches!(opened, Err(StoreError::Broken { .. })) {
            self.worsen(Condition::Damaged);
        }
        let before = *self.condition.get_mut();
        *self = opened?;
        self.condition.fetch_max(before, Ordering::Relaxed);
        if let Err(error) = rewritten {
            self.fault.note(&error.to_string(), true);
        }
        self.write(|write| {
            write.open_table(PROBE).map_err(writing)?.insert(0, vec![0; PROBE_BYTES].as_slice()).map_err(writing)?;
            Ok(())
        })?;
        self.write(|write| write.delete_table(PROBE).map(drop).map_err(writing))
    }

    /// Checks the sums of everything in the file; none: it is closed.
    pub(super) fn check_sums(&mut self) -> Result<Option<bool>, String> {
        let whole = guarded(&self.path, || self.database.as_mut().map(Database::check_integrity));
        whole.map_err(|panic| self.damaged("read", &panic).to_string())?.transpose().map_err(|error| error.to_string())
    }

    /// Closes the file. Of one in which something is damaged only the lock is given back: the
    /// storage library would write to it once more.
    pub(super) fn close(&mut self) {
        let Some(database) = self.database.take() else { return };
        if self.is_at_least(Condition::Misread) {
            std::mem::forget(database);
            if let Err(error) = self.file.close() {
                tracing::debug!("the lock of the store stays until the program ends: {error}");
            }
        } else if let Err(panic) = guarded(&self.path, || drop(database)) {
            tracing::error!("the store could not be closed: {}", damage(&panic));
        }
    }
}

impl Drop for OpenStore {
    fn drop(&mut self) {
        self.close();
    }
}

fn make_tables(write: &WriteTransaction) -> Result<(), StoreError> {
    write.open_table(INCREMENTS).map_err(writing)?;
    write.open_table(LOG).map_err(writing)?;
    write.open_table(COMPACTED).map_err(writing)?;
    write.open_table(FLOORS).map_err(writing)?;
    write.open_table(FLOOR_VERSIONS).map_err(writing)?;
    let mut meta = write.open_table(META).map_err(writing)?;
    meta.insert(FORMAT_KEY, FORMAT).map_err(writing)?;
    Ok(())
}

/// Writes everything that the file has once more. A disk that failed to bring what it was given to
/// safety may have forgotten it, while the system goes on showing it. The first page says what
/// counts of the rest, and comes last.
fn rewrite(disk: &dyn StoreDisk) -> io::Result<()> {
    const FIRST: u64 = 4096;
    const PART: u64 = 1 << 20;
    let (file, reason) = disk.open()?;
    if let Some(reason) = reason {
        return Err(io::Error::other(reason));
    }
    let length = file.len()?;
    let again = |begin: u64, end: u64| {
        let mut part = vec![0; usize::try_from(end - begin).unwrap_or(0)];
        file.read(begin, &mut part)?;
        file.write(begin, &part)
    };
    let mut begin = FIRST;
    while begin < length {
        again(begin, length.min(begin + PART))?;
        begin += PART;
    }
    file.sync_data()?;
    again(0, length.min(FIRST))?;
    file.sync_data()
}
