//! The durable log in one `redb` file.
//!
//! | table | key | value |
//! | --- | --- | --- |
//! | `increments` | map, author, number | the increment in its envelope |
//! | `log` | map, sequence number from 1 | author, number: the order of storing |
//! | `folds` | map, author, last number | first number, the compacted series in its envelope |
//! | `floors` | map, author | number up to which this author's increments are folded |
//! | `floor versions` | map | the version up to which the log is folded |
//! | `deletions` | map | that it will be deleted, or was: JSON; absent until a map is to be |
//! | `meta` | `format` | version of this layout |
//!
//! The log of a compacted map begins after its floor.

mod deletions;

use crate::store::guard::guarded;
use crate::store::log::{
    CompactedRecord, CompactionFloor, DeletionRecord, IncrementLog, LogReader, Piece, Record, StoreError, Stored,
    Visit, gaps,
};
use fht_proto::{AuthorId, MapName, VersionVector};
use redb::{Database, ReadableDatabase, TableDefinition, TableError};
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::ops::ControlFlow;
use std::path::Path;

const INCREMENTS: TableDefinition<'_, (&str, u32, u64), &[u8]> = TableDefinition::new("increments");
const LOG: TableDefinition<'_, (&str, u64), (u32, u64)> = TableDefinition::new("log");
const COMPACTED: TableDefinition<'_, (&str, u32, u64), (u64, &[u8])> = TableDefinition::new("folds");
const FLOORS: TableDefinition<'_, (&str, u32), u64> = TableDefinition::new("floors");
const FLOOR_VERSIONS: TableDefinition<'_, &str, u64> = TableDefinition::new("floor versions");
const META: TableDefinition<'_, &str, u64> = TableDefinition::new("meta");
const FORMAT_KEY: &str = "format";
/// Format 1 had no compacted series.
const FORMAT: u64 = 2;
/// The file in the data directory.
pub const FILE_NAME: &str = "maps.redb";
/// The file while it is being made.
const UNFINISHED_NAME: &str = "maps.redb.new";
/// Locked by the server that uses the directory.
pub(crate) const LOCK_NAME: &str = "lock";

fn reading(error: impl Into<redb::Error>) -> StoreError {
    StoreError::Disk { action: "read", reason: error.into().to_string() }
}

fn writing(error: impl Into<redb::Error>) -> StoreError {
    StoreError::Disk { action: "written", reason: error.into().to_string() }
}

/// What a panic over a damaged file is.
fn reading_guarded<T>(work: impl FnOnce() -> Result<T, StoreError>) -> Result<T, StoreError> {
    guarded(work).unwrap_or_else(|panic| Err(StoreError::Disk { action: "read", reason: damage(&panic) }))
}

fn writing_guarded<T>(work: impl FnOnce() -> Result<T, StoreError>) -> Result<T, StoreError> {
    guarded(work).unwrap_or_else(|panic| Err(StoreError::Disk { action: "written", reason: damage(&panic) }))
}

fn damage(panic: &str) -> String {
    format!("the file is damaged ({panic})")
}

/// The open store.
#[derive(Debug)]
pub struct RedbLog {
    // There until it is dropped: closing a damaged file may panic, too.
    database: Option<Database>,
    // Held until the store is closed: only one server at a time.
    _lock: Option<File>,
}

impl RedbLog {
    /// Opens the store in `dir`, making both if absent. A file left by a crash is repaired here,
    /// and an older layout is brought up to date.
    ///
    /// # Errors
    /// [`StoreError::InUse`], [`StoreError::Open`], [`StoreError::Format`], [`StoreError::Disk`].
    pub fn open(dir: &Path) -> Result<Self, StoreError> {
        let failed = |error: std::io::Error| StoreError::Open { dir: dir.to_owned(), reason: error.to_string() };
        let lock = Self::lock(dir)?;
        let path = dir.join(FILE_NAME);
        if !path.try_exists().map_err(failed)? {
            // Made under another name: a server that is killed meanwhile leaves nothing that the
            // next one could take for a store.
            let unfinished = dir.join(UNFINISHED_NAME);
            match std::fs::remove_file(&unfinished) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(error)),
                _ => {}
            }
            drop(Self::open_file(dir, &unfinished, None)?);
            std::fs::rename(&unfinished, &path).map_err(failed)?;
        }
        // The file's name must survive a power failure, too.
        File::open(dir).and_then(|dir| dir.sync_all()).map_err(failed)?;
        Self::open_file(dir, &path, Some(lock))
    }

    /// Makes `dir` if it is absent, and keeps others from using a store in it until the file is
    /// dropped.
    ///
    /// # Errors
    /// [`StoreError::InUse`], [`StoreError::Open`].
    pub(crate) fn lock(dir: &Path) -> Result<File, StoreError> {
        let failed = |error: std::io::Error| StoreError::Open { dir: dir.to_owned(), reason: error.to_string() };
        std::fs::create_dir_all(dir).map_err(failed)?;
        let lock = File::create(dir.join(LOCK_NAME)).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => Ok(lock),
            Err(TryLockError::WouldBlock) => Err(StoreError::InUse { dir: dir.to_owned() }),
            Err(TryLockError::Error(error)) => Err(failed(error)),
        }
    }

    /// Opens the store in `dir`, which must be there, and checks the sums of all that is in it.
    /// Nobody else may use it meanwhile.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub(crate) fn open_checked(dir: &Path) -> Result<Self, StoreError> {
        let path = dir.join(FILE_NAME);
        let mut log = Self::open_file(dir, &path, None)?;
        let broken = |reason: String| StoreError::Broken { file: path.clone(), reason };
        let whole = guarded(|| log.database.as_mut().map(Database::check_integrity));
        match whole.map_err(|panic| broken(damage(&panic)))? {
            Some(Ok(true)) | None => Ok(log),
            Some(Ok(false)) => Err(broken("its sums do not hold".to_owned())),
            Some(Err(error)) => Err(broken(error.to_string())),
        }
    }

    fn open_file(dir: &Path, path: &Path, lock: Option<File>) -> Result<Self, StoreError> {
        let broken = |reason: String| StoreError::Broken { file: path.to_owned(), reason };
        if path.metadata().is_ok_and(|file| file.len() == 0) {
            return Err(broken("it is empty".to_owned()));
        }
        let opened = guarded(|| Database::create(path)).map_err(|panic| broken(damage(&panic)))?;
        let database = opened.map_err(|error| match error {
            redb::DatabaseError::DatabaseAlreadyOpen => StoreError::InUse { dir: dir.to_owned() },
            redb::DatabaseError::Storage(redb::StorageError::Corrupted(reason)) => broken(reason),
            redb::DatabaseError::Storage(redb::StorageError::Io(error)) if error.kind() == ErrorKind::InvalidData => {
                broken(error.to_string())
            }
            other => StoreError::Open { dir: dir.to_owned(), reason: other.to_string() },
        })?;
        let store = Self { database: Some(database), _lock: lock };
        match reading_guarded(|| store.format()).map_err(|error| error.of_file(path))? {
            Some(FORMAT) => Ok(store),
            // Format 2 only adds tables.
            None | Some(1) => writing_guarded(|| store.make_tables()).map(|()| store),
            Some(found) => Err(StoreError::Format { dir: dir.to_owned(), found, known: FORMAT }),
        }
    }

    fn begin_read(&self) -> Result<redb::ReadTransaction, StoreError> {
        let closed = || StoreError::Disk { action: "read", reason: "it is closed".to_owned() };
        self.database.as_ref().ok_or_else(closed)?.begin_read().map_err(reading)
    }

    fn begin_write(&self) -> Result<redb::WriteTransaction, StoreError> {
        let closed = || StoreError::Disk { action: "written", reason: "it is closed".to_owned() };
        self.database.as_ref().ok_or_else(closed)?.begin_write().map_err(writing)
    }

    /// The format of the file; none in a new one.
    fn format(&self) -> Result<Option<u64>, StoreError> {
        let read = self.begin_read()?;
        let meta = match read.open_table(META) {
            Err(TableError::TableDoesNotExist(_)) => return Ok(None),
            other => other.map_err(reading)?,
        };
        Ok(meta.get(FORMAT_KEY).map_err(reading)?.map(|format| format.value()))
    }

    fn make_tables(&self) -> Result<(), StoreError> {
        let write = self.begin_write()?;
        write.open_table(INCREMENTS).map_err(writing)?;
        write.open_table(LOG).map_err(writing)?;
        write.open_table(COMPACTED).map_err(writing)?;
        write.open_table(FLOORS).map_err(writing)?;
        write.open_table(FLOOR_VERSIONS).map_err(writing)?;
        let mut meta = write.open_table(META).map_err(writing)?;
        meta.insert(FORMAT_KEY, FORMAT).map_err(writing)?;
        drop(meta);
        write.commit().map_err(writing)
    }
}

impl Drop for RedbLog {
    fn drop(&mut self) {
        let database = self.database.take();
        if let Err(panic) = guarded(|| drop(database)) {
            tracing::error!("the store could not be closed: {}", damage(&panic));
        }
    }
}

fn floor_of(read: &redb::ReadTransaction, map: &MapName) -> Result<CompactionFloor, StoreError> {
    let versions = read.open_table(FLOOR_VERSIONS).map_err(reading)?;
    let version = versions.get(map.as_str()).map_err(reading)?.map_or(0, |version| version.value());
    let floors = read.open_table(FLOORS).map_err(reading)?;
    let mut vector = VersionVector::default();
    for entry in floors.range((map.as_str(), 0)..=(map.as_str(), u32::MAX)).map_err(reading)? {
        let (key, number) = entry.map_err(reading)?;
        vector.set(AuthorId(key.value().1), number.value());
    }
    Ok(CompactionFloor { version, vector })
}

fn put_compacted(
    write: &redb::WriteTransaction,
    map: &MapName,
    floor: &CompactionFloor,
    new: &[CompactedRecord],
) -> Result<(), StoreError> {
    let name = map.as_str();
    let mut compacted = write.open_table(COMPACTED).map_err(writing)?;
    for series in new {
        compacted
            .insert((name, series.author.0, series.last), (series.first, series.bytes.as_slice()))
            .map_err(writing)?;
    }
    let mut floors = write.open_table(FLOORS).map_err(writing)?;
    for (author, last) in floor.vector.iter() {
        floors.insert((name, author.0), last).map_err(writing)?;
    }
    let mut versions = write.open_table(FLOOR_VERSIONS).map_err(writing)?;
    versions.insert(name, floor.version).map_err(writing)?;
    Ok(())
}

impl IncrementLog for RedbLog {
    fn reader(&self) -> &dyn LogReader {
        self
    }

    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        writing_guarded(|| {
            let mut write = self.begin_write()?;
            // Commits in two phases and keeps what a repair needs: recovery after a crash takes no
            // longer for a large file, and does not depend on checksums over bytes that strangers
            // chose.
            write.set_quick_repair(true);
            let mut increments = write.open_table(INCREMENTS).map_err(writing)?;
            let mut log = write.open_table(LOG).map_err(writing)?;
            for record in records {
                let (map, author) = (record.map.as_str(), record.author.0);
                increments.insert((map, author, record.number), record.bytes.as_slice()).map_err(writing)?;
                log.insert((map, record.sequence), (author, record.number)).map_err(writing)?;
            }
            drop((increments, log));
            write.commit().map_err(writing)
        })
    }

    fn add_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        writing_guarded(|| {
            let mut write = self.begin_write()?;
            write.set_quick_repair(true);
            put_compacted(&write, map, floor, series)?;
            write.commit().map_err(writing)
        })
    }

    fn replace_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        new: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        writing_guarded(|| {
            let name = map.as_str();
            let mut write = self.begin_write()?;
            write.set_quick_repair(true);
            let mut increments = write.open_table(INCREMENTS).map_err(writing)?;
            let mut compacted = write.open_table(COMPACTED).map_err(writing)?;
            for (author, last) in floor.vector.iter() {
                increments.retain_in((name, author.0, 0)..=(name, author.0, last), |_, _| false).map_err(writing)?;
                compacted.retain_in((name, author.0, 0)..=(name, author.0, last), |_, _| false).map_err(writing)?;
            }
            let mut log = write.open_table(LOG).map_err(writing)?;
            log.retain_in((name, 0)..=(name, floor.version), |_, _| false).map_err(writing)?;
            drop((increments, compacted, log));
            put_compacted(&write, map, floor, new)?;
            write.commit().map_err(writing)
        })
    }

    fn set_deletion(&self, map: &MapName, record: Option<&DeletionRecord>) -> Result<(), StoreError> {
        self.write_deletion(map, record)
    }

    fn delete_map(&self, map: &MapName, record: &DeletionRecord) -> Result<(), StoreError> {
        self.write_end(map, record)
    }
}

impl LogReader for RedbLog {
    fn deletions(&self) -> Result<BTreeMap<MapName, DeletionRecord>, StoreError> {
        self.read_deletions()
    }

    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        reading_guarded(|| {
            let read = self.begin_read()?;
            let increments = read.open_table(INCREMENTS).map_err(reading)?;
            if let Some(bytes) = increments.get((map.as_str(), author.0, number)).map_err(reading)? {
                return Ok(Stored::Increment(bytes.value().to_vec()));
            }
            let floor = floor_of(&read, map)?;
            Ok(if (1..=floor.vector.get(author)).contains(&number) { Stored::Compacted } else { Stored::Absent })
        })
    }

    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        reading_guarded(|| {
            let read = self.begin_read()?;
            let compacted = read.open_table(COMPACTED).map_err(reading)?;
            let first = (of.map_or("", MapName::as_str), 0, 0);
            let is_other = |map: &str| of.is_some_and(|of| of.as_str() != map);
            for entry in compacted.range(first..).map_err(reading)? {
                let (key, value) = entry.map_err(reading)?;
                let (map, author, last) = key.value();
                if is_other(map) {
                    break;
                }
                visit(map, AuthorId(author), last, Piece::Compacted(value.value().1))?;
            }
            let increments = read.open_table(INCREMENTS).map_err(reading)?;
            for entry in increments.range(first..).map_err(reading)? {
                let (key, bytes) = entry.map_err(reading)?;
                let (map, author, number) = key.value();
                if is_other(map) {
                    break;
                }
                visit(map, AuthorId(author), number, Piece::Increment(bytes.value()))?;
            }
            Ok(())
        })
    }

    fn for_each_lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        visit: &mut dyn FnMut(Piece<'_>) -> ControlFlow<()>,
    ) -> Result<(), StoreError> {
        reading_guarded(|| {
            let read = self.begin_read()?;
            let increments = read.open_table(INCREMENTS).map_err(reading)?;
            let compacted = read.open_table(COMPACTED).map_err(reading)?;
            for (author, first, last) in gaps(have, upto) {
                let range = (map.as_str(), author.0, first)..=(map.as_str(), author.0, last);
                for entry in compacted.range(range.clone()).map_err(reading)? {
                    if visit(Piece::Compacted(entry.map_err(reading)?.1.value().1)).is_break() {
                        return Ok(());
                    }
                }
                for entry in increments.range(range).map_err(reading)? {
                    if visit(Piece::Increment(entry.map_err(reading)?.1.value())).is_break() {
                        return Ok(());
                    }
                }
            }
            Ok(())
        })
    }

    fn vector_at(&self, map: &MapName, version: u64) -> Result<Option<VersionVector>, StoreError> {
        reading_guarded(|| {
            let read = self.begin_read()?;
            let floor = floor_of(&read, map)?;
            if version < floor.version {
                return Ok(None);
            }
            let log = read.open_table(LOG).map_err(reading)?;
            let mut vector = floor.vector;
            for entry in log.range((map.as_str(), floor.version + 1)..=(map.as_str(), version)).map_err(reading)? {
                let (author, number) = entry.map_err(reading)?.1.value();
                vector.set(AuthorId(author), number);
            }
            Ok(Some(vector))
        })
    }

    fn floor(&self, map: &MapName) -> Result<CompactionFloor, StoreError> {
        reading_guarded(|| {
            let read = self.begin_read()?;
            floor_of(&read, map)
        })
    }
}
