//! The durable log in one `redb` file.
//!
//! | table | key | value |
//! | --- | --- | --- |
//! | `increments` | map, author, number | the increment in its envelope |
//! | `log` | map, sequence number from 1 | author, number: the order of storing |
//! | `folds` | map, author, last number | first number, the compacted series in its envelope |
//! | `floors` | map, author | number up to which this author's increments are folded |
//! | `floor versions` | map | the version up to which the log is folded |
//! | `ends` | map, author | number of the last increment, and a sum: what a rescue goes by |
//! | `deletions` | map | that it will be deleted, or was: JSON; absent until a map is to be |
//! | `meta` | `format` | version of this layout |
//! | `meta` | `lost/`map | how many of its increments a rescue did not find; absent: none |
//!
//! The log of a compacted map begins after its floor.

mod deletions;
mod directory;
mod directory_lock;
mod ends;
mod file_mark;
mod open_store;
mod steady_file;
mod tables;

pub(crate) use directory_lock::{DirectoryLock, LOCK_NAME};
pub(crate) use ends::end_sum;
pub use open_store::{FILE_NAME, StoreDisk};

use crate::store::error::StoreError;
use crate::store::log::{
    CompactedRecord, CompactionFloor, DeletionRecord, IncrementLog, LogReader, Piece, Record, Stored, Visit, gaps,
};
use fht_proto::{AuthorId, MapName, VersionVector};
use open_store::OpenStore;
use redb::{ReadTransaction, ReadableTable, WriteTransaction};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::sync::{PoisonError, RwLock, RwLockReadGuard};
use tables::{COMPACTED, FLOOR_VERSIONS, FLOORS, INCREMENTS, LOG, META, reading, writing};

/// The open store.
///
/// When the disk does not take a write, or something else has the file's name, the store is what it
/// was before, can be read, and refuses everything else until
/// [`try_again`](IncrementLog::try_again) has written to the disk.
#[derive(Debug)]
pub struct RedbLog {
    /// Opened anew after a fault.
    open: RwLock<OpenStore>,
    disk: Box<dyn StoreDisk>,
    /// With less room left there is a warning, bytes.
    min_free_bytes: u64,
    // Held until the store is closed: only one server at a time.
    lock: Option<DirectoryLock>,
}

impl RedbLog {
    /// Opens the store that is on a disk; makes one if the disk has no byte.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn on_disk(disk: Box<dyn StoreDisk>) -> Result<Self, StoreError> {
        let open = OpenStore::open(disk.as_ref())?;
        Ok(Self { open: RwLock::new(open), disk, min_free_bytes: 0, lock: None })
    }

    /// The same, with a [`warning`](IncrementLog::warning) when less room than this is left, bytes.
    #[must_use]
    pub fn warning_below(self, min_free_bytes: u64) -> Self {
        let mut log = self;
        log.min_free_bytes = min_free_bytes;
        log
    }

    fn opened(&self) -> RwLockReadGuard<'_, OpenStore> {
        self.open.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn read<T>(&self, work: impl FnOnce(&ReadTransaction) -> Result<T, StoreError>) -> Result<T, StoreError> {
        self.opened().read(work)
    }

    fn write(&self, work: impl FnOnce(&WriteTransaction) -> Result<(), StoreError>) -> Result<(), StoreError> {
        self.opened().write(work)
    }
}

/// The note that increments of a map are lost.
fn lost_key(map: &MapName) -> String {
    format!("lost/{map}")
}

fn floor_of(read: &ReadTransaction, map: &MapName) -> Result<CompactionFloor, StoreError> {
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
    write: &WriteTransaction,
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
    ends::note(write, floor.vector.iter().map(|(author, last)| ((name, author), last)))
}

impl RedbLog {
    /// Notes that so many increments of a map are lost.
    ///
    /// # Errors
    /// [`StoreError::Disk`].
    pub(crate) fn note_lost(&self, map: &MapName, count: u64) -> Result<(), StoreError> {
        self.write(|write| {
            let mut meta = write.open_table(META).map_err(writing)?;
            meta.insert(lost_key(map).as_str(), count).map_err(writing)?;
            Ok(())
        })
    }
}

impl IncrementLog for RedbLog {
    fn reader(&self) -> &dyn LogReader {
        self
    }

    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        self.write(|write| {
            let mut increments = write.open_table(INCREMENTS).map_err(writing)?;
            let mut log = write.open_table(LOG).map_err(writing)?;
            let mut lasts: BTreeMap<(&str, AuthorId), u64> = BTreeMap::new();
            for record in records {
                let (map, author) = (record.map.as_str(), record.author.0);
                increments.insert((map, author, record.number), record.bytes.as_slice()).map_err(writing)?;
                log.insert((map, record.sequence), (author, record.number)).map_err(writing)?;
                let last = lasts.entry((map, record.author)).or_default();
                *last = record.number.max(*last);
            }
            ends::note(write, lasts)
        })
    }

    fn add_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        self.write(|write| put_compacted(write, map, floor, series))
    }

    fn replace_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        new: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        self.write(|write| {
            let name = map.as_str();
            let mut increments = write.open_table(INCREMENTS).map_err(writing)?;
            let mut compacted = write.open_table(COMPACTED).map_err(writing)?;
            for (author, last) in floor.vector.iter() {
                increments.retain_in((name, author.0, 0)..=(name, author.0, last), |_, _| false).map_err(writing)?;
                compacted.retain_in((name, author.0, 0)..=(name, author.0, last), |_, _| false).map_err(writing)?;
            }
            let mut log = write.open_table(LOG).map_err(writing)?;
            log.retain_in((name, 0)..=(name, floor.version), |_, _| false).map_err(writing)?;
            drop((increments, compacted, log));
            put_compacted(write, map, floor, new)
        })
    }

    fn set_deletion(&self, map: &MapName, record: Option<&DeletionRecord>) -> Result<(), StoreError> {
        self.write_deletion(map, record)
    }

    fn delete_map(&self, map: &MapName, record: &DeletionRecord) -> Result<(), StoreError> {
        self.write_end(map, record)
    }

    fn move_map(
        &self,
        map: &MapName,
        to: &MapName,
        vector: &VersionVector,
        record: &DeletionRecord,
    ) -> Result<(), StoreError> {
        self.write_move(map, to, vector, record)
    }

    fn fault(&self) -> Option<String> {
        self.opened().fault()
    }

    fn distrust(&self) {
        self.opened().distrust();
    }

    fn look(&self) {
        let open = self.opened();
        if open.fault().is_none()
            && let Some(reason) = self.disk.displaced()
        {
            open.note_fault(&reason);
        }
    }

    fn free_bytes(&self) -> Option<u64> {
        self.disk.free_bytes()
    }

    fn warning(&self) -> Option<String> {
        let free = self.disk.free_bytes().filter(|free| *free < self.min_free_bytes)?;
        let mib = |bytes: u64| bytes >> 20;
        Some(format!(
            "{} MiB of room are left where the maps are kept, less than {} MiB: when it is full, nothing more is taken in",
            mib(free),
            mib(self.min_free_bytes)
        ))
    }

    fn try_again(&self) -> Result<(), StoreError> {
        self.open.write().unwrap_or_else(PoisonError::into_inner).reopen(self.disk.as_ref())
    }
}

impl LogReader for RedbLog {
    fn maps(&self) -> Result<BTreeSet<String>, StoreError> {
        self.read(|read| {
            let (log, floors) =
                (read.open_table(LOG).map_err(reading)?, read.open_table(FLOOR_VERSIONS).map_err(reading)?);
            let mut maps = BTreeSet::new();
            for entry in floors.iter().map_err(reading)? {
                maps.insert(entry.map_err(reading)?.0.value().to_owned());
            }
            let mut next = log.first().map_err(reading)?.map(|(key, _)| key.value().0.to_owned());
            while let Some(map) = next {
                let mut others = log.range((map.as_str(), u64::MAX)..).map_err(reading)?;
                let other = others.find(|entry| !entry.as_ref().is_ok_and(|(key, _)| key.value().0 == map));
                next = other.transpose().map_err(reading)?.map(|(key, _)| key.value().0.to_owned());
                maps.insert(map);
            }
            Ok(maps)
        })
    }

    fn deletions(&self) -> Result<BTreeMap<MapName, DeletionRecord>, StoreError> {
        self.read_deletions()
    }

    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        self.read(|read| {
            let increments = read.open_table(INCREMENTS).map_err(reading)?;
            if let Some(bytes) = increments.get((map.as_str(), author.0, number)).map_err(reading)? {
                return Ok(Stored::Increment(bytes.value().to_vec()));
            }
            let floor = floor_of(read, map)?;
            Ok(if (1..=floor.vector.get(author)).contains(&number) { Stored::Compacted } else { Stored::Absent })
        })
    }

    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        self.read(|read| {
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
        self.read(|read| {
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
        self.read(|read| {
            let floor = floor_of(read, map)?;
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
        self.read(|read| floor_of(read, map))
    }

    fn lost(&self, map: &MapName) -> Result<u64, StoreError> {
        self.read(|read| {
            let meta = read.open_table(META).map_err(reading)?;
            Ok(meta.get(lost_key(map).as_str()).map_err(reading)?.map_or(0, |count| count.value()))
        })
    }
}
