//! The durable log: every increment that was ever acknowledged, in one `redb` file.
//!
//! | table | key | value |
//! | --- | --- | --- |
//! | `increments` | map, author, number | the increment in its envelope |
//! | `log` | map, sequence number from 1 | author, number: the order in which the server stored them |
//! | `meta` | `format` | version of this layout |
//!
//! A map's scalar version is the length of its log, so that version N of a map is what its first N entries add up to.

use fht_proto::envelope::FORMAT_VERSION;
use fht_proto::{AuthorId, MapName, VersionVector};
use redb::{Database, ReadableDatabase, ReadableTable, TableDefinition, TableError};
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

const INCREMENTS: TableDefinition<'_, (&str, u32, u64), &[u8]> = TableDefinition::new("increments");
const LOG: TableDefinition<'_, (&str, u64), (u32, u64)> = TableDefinition::new("log");
const META: TableDefinition<'_, &str, u64> = TableDefinition::new("meta");
const FORMAT_KEY: &str = "format";
const FORMAT: u64 = 1;
/// The file in the data directory.
pub const FILE_NAME: &str = "maps.redb";
/// The file while it is made.
const UNFINISHED_NAME: &str = "maps.redb.new";
/// Locked by the server that uses the directory.
const LOCK_NAME: &str = "lock";

/// Why the store failed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Another process has it open.
    #[error("the data directory {} is in use by another map-server", dir.display())]
    InUse {
        /// The data directory.
        dir: PathBuf,
    },
    /// The directory cannot be made or the file not be opened.
    #[error("the data directory {} cannot be used: {reason}", dir.display())]
    Open {
        /// The data directory.
        dir: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// Written by another version of this program.
    #[error("the data directory {} has format {found}; this program reads format {FORMAT}", dir.display())]
    Format {
        /// The data directory.
        dir: PathBuf,
        /// The format found.
        found: u64,
    },
    /// Reading or writing failed.
    #[error("the store cannot be {action}: {reason}")]
    Disk {
        /// `read` or `written`.
        action: &'static str,
        /// What the system says.
        reason: String,
    },
    /// A later version of this program has stored increments.
    #[error(
        "the store has increments of format {found} in map {map}; this program reads format {FORMAT_VERSION}: use the \
         map-server that wrote them"
    )]
    IncrementFormat {
        /// The map.
        map: String,
        /// The format found.
        found: u8,
    },
    /// What was read is not what was written.
    #[error("the store is damaged: map {map}: {reason}")]
    Damaged {
        /// The map.
        map: String,
        /// What is wrong.
        reason: String,
    },
}

fn reading(error: impl Into<redb::Error>) -> StoreError {
    StoreError::Disk { action: "read", reason: error.into().to_string() }
}

fn writing(error: impl Into<redb::Error>) -> StoreError {
    StoreError::Disk { action: "written", reason: error.into().to_string() }
}

/// An increment to be stored.
#[derive(Clone, Debug)]
pub struct Record {
    /// The map.
    pub map: MapName,
    /// Its place in the map's log, from 1.
    pub sequence: u64,
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
    /// The increment in its envelope.
    pub bytes: Vec<u8>,
}

/// The open store.
#[derive(Debug)]
pub struct Store {
    database: Database,
    // Held until the store is closed: one server at a time.
    _lock: Option<File>,
}

impl Store {
    /// Opens the store in `dir`, making both if absent. After a crash the file is repaired here.
    ///
    /// # Errors
    /// [`StoreError::InUse`], [`StoreError::Open`], [`StoreError::Format`], [`StoreError::Disk`].
    pub fn open(dir: &Path) -> Result<Self, StoreError> {
        let failed = |error: std::io::Error| StoreError::Open { dir: dir.to_owned(), reason: error.to_string() };
        std::fs::create_dir_all(dir).map_err(failed)?;
        let lock = File::create(dir.join(LOCK_NAME)).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(StoreError::InUse { dir: dir.to_owned() }),
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let path = dir.join(FILE_NAME);
        if !path.try_exists().map_err(failed)? {
            // Made under another name: a server that is killed meanwhile leaves nothing that the next one would take for a
            // store.
            let unfinished = dir.join(UNFINISHED_NAME);
            match std::fs::remove_file(&unfinished) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(failed(error)),
                _ => {}
            }
            drop(Self::open_file(dir, &unfinished, None)?);
            std::fs::rename(&unfinished, &path).map_err(failed)?;
        }
        // The file's name must outlive a power failure, too.
        File::open(dir).and_then(|dir| dir.sync_all()).map_err(failed)?;
        Self::open_file(dir, &path, Some(lock))
    }

    fn open_file(dir: &Path, path: &Path, lock: Option<File>) -> Result<Self, StoreError> {
        let database = Database::create(path).map_err(|error| match error {
            redb::DatabaseError::DatabaseAlreadyOpen => StoreError::InUse { dir: dir.to_owned() },
            other => StoreError::Open { dir: dir.to_owned(), reason: other.to_string() },
        })?;
        let store = Self { database, _lock: lock };
        match store.format()? {
            Some(FORMAT) => Ok(store),
            Some(found) => Err(StoreError::Format { dir: dir.to_owned(), found }),
            None => store.make_tables().map(|()| store),
        }
    }

    /// The format of the file; none in a new one.
    fn format(&self) -> Result<Option<u64>, StoreError> {
        let read = self.database.begin_read().map_err(reading)?;
        let meta = match read.open_table(META) {
            Err(TableError::TableDoesNotExist(_)) => return Ok(None),
            other => other.map_err(reading)?,
        };
        Ok(meta.get(FORMAT_KEY).map_err(reading)?.map(|format| format.value()))
    }

    fn make_tables(&self) -> Result<(), StoreError> {
        let write = self.database.begin_write().map_err(writing)?;
        write.open_table(INCREMENTS).map_err(writing)?;
        write.open_table(LOG).map_err(writing)?;
        let mut meta = write.open_table(META).map_err(writing)?;
        meta.insert(FORMAT_KEY, FORMAT).map_err(writing)?;
        drop(meta);
        write.commit().map_err(writing)
    }

    /// Stores all records in one commit. When this returns they are on the disk; if it fails, none is.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        let mut write = self.database.begin_write().map_err(writing)?;
        // Commits in two phases and keeps what a repair needs: recovery after a crash takes no longer for a large file, and
        // does not rest on checksums over bytes that strangers chose.
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
    }

    /// The bytes of one increment, if it is stored.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub fn get(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Option<Vec<u8>>, StoreError> {
        let read = self.database.begin_read().map_err(reading)?;
        let increments = read.open_table(INCREMENTS).map_err(reading)?;
        let found = increments.get((map.as_str(), author.0, number)).map_err(reading)?;
        Ok(found.map(|bytes| bytes.value().to_vec()))
    }

    /// Shows every stored increment to `visit`: by map, author, number.
    ///
    /// # Errors
    /// [`StoreError::Disk`], and whatever `visit` returns.
    pub fn for_each(
        &self,
        mut visit: impl FnMut(&str, AuthorId, u64, &[u8]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let read = self.database.begin_read().map_err(reading)?;
        let increments = read.open_table(INCREMENTS).map_err(reading)?;
        for entry in increments.iter().map_err(reading)? {
            let (key, bytes) = entry.map_err(reading)?;
            let (map, author, number) = key.value();
            visit(map, AuthorId(author), number, bytes.value())?;
        }
        Ok(())
    }

    /// The increments that `upto` contains and `have` does not, each author's in order, until they exceed `max_bytes`. At
    /// least one, if any is lacking.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub fn lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        max_bytes: usize,
    ) -> Result<Vec<Vec<u8>>, StoreError> {
        let read = self.database.begin_read().map_err(reading)?;
        let increments = read.open_table(INCREMENTS).map_err(reading)?;
        let (mut found, mut total) = (Vec::new(), 0);
        for (author, last) in upto.iter() {
            let Some(first) = have.get(author).checked_add(1).filter(|&first| first <= last) else { continue };
            let range = (map.as_str(), author.0, first)..=(map.as_str(), author.0, last);
            for entry in increments.range(range).map_err(reading)? {
                let (_, bytes) = entry.map_err(reading)?;
                total += bytes.value().len();
                if total > max_bytes && !found.is_empty() {
                    return Ok(found);
                }
                found.push(bytes.value().to_vec());
            }
        }
        Ok(found)
    }

    /// The vector of version `version`: what the first so many log entries contain.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub fn vector_at(&self, map: &MapName, version: u64) -> Result<VersionVector, StoreError> {
        let read = self.database.begin_read().map_err(reading)?;
        let log = read.open_table(LOG).map_err(reading)?;
        let mut vector = VersionVector::default();
        for entry in log.range((map.as_str(), 1)..=(map.as_str(), version)).map_err(reading)? {
            let (author, number) = entry.map_err(reading)?.1.value();
            vector.set(AuthorId(author), number);
        }
        Ok(vector)
    }
}
