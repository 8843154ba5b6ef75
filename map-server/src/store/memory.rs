//! The log in memory: for a server whose increments are kept elsewhere, and for tests.

use crate::store::error::StoreError;
use crate::store::log::{
    CompactedRecord, CompactionFloor, DeletionRecord, IncrementLog, LogReader, Piece, Record, Stored, Visit, gaps,
};
use fht_proto::{AuthorId, MapName, VersionVector};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

#[derive(Clone, Debug, Default)]
struct MapLog {
    increments: BTreeMap<(AuthorId, u64), Vec<u8>>,
    /// By author and last number.
    compacted: BTreeMap<(AuthorId, u64), Vec<u8>>,
    /// The order in which they were stored, after the floor.
    order: Vec<(AuthorId, u64)>,
    floor: CompactionFloor,
}

impl MapLog {
    /// `series` stand for everything up to `floor`.
    fn compact(&mut self, floor: &CompactionFloor, series: &[CompactedRecord]) {
        self.compacted.extend(series.iter().map(|series| ((series.author, series.last), series.bytes.clone())));
        self.floor = floor.clone();
    }
}

/// A log that ends with the process.
#[derive(Debug, Default)]
pub struct MemoryLog {
    maps: Mutex<BTreeMap<MapName, MapLog>>,
    deletions: Mutex<BTreeMap<MapName, DeletionRecord>>,
}

impl MemoryLog {
    /// An empty log.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<MapName, MapLog>> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lock_deletions(&self) -> MutexGuard<'_, BTreeMap<MapName, DeletionRecord>> {
        self.deletions.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl IncrementLog for MemoryLog {
    fn reader(&self) -> &dyn LogReader {
        self
    }

    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        let mut maps = self.lock();
        for record in records {
            let log = maps.entry(record.map.clone()).or_default();
            log.increments.insert((record.author, record.number), record.bytes.clone());
            log.order.push((record.author, record.number));
        }
        Ok(())
    }

    fn add_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        self.lock().entry(map.clone()).or_default().compact(floor, series);
        Ok(())
    }

    fn replace_compacted(
        &self,
        map: &MapName,
        floor: &CompactionFloor,
        series: &[CompactedRecord],
    ) -> Result<(), StoreError> {
        let mut maps = self.lock();
        let log = maps.entry(map.clone()).or_default();
        let is_compacted = |author: AuthorId, number: u64| number <= floor.vector.get(author);
        log.increments.retain(|&(author, number), _| !is_compacted(author, number));
        log.compacted.retain(|&(author, last), _| !is_compacted(author, last));
        let dropped = usize::try_from(floor.version.saturating_sub(log.floor.version)).unwrap_or(usize::MAX);
        log.order.drain(..dropped.min(log.order.len()));
        log.compact(floor, series);
        Ok(())
    }

    fn set_deletion(&self, map: &MapName, record: Option<&DeletionRecord>) -> Result<(), StoreError> {
        let mut deletions = self.lock_deletions();
        match record {
            Some(record) => _ = deletions.insert(map.clone(), record.clone()),
            None => _ = deletions.remove(map),
        }
        Ok(())
    }

    fn delete_map(&self, map: &MapName, record: &DeletionRecord) -> Result<(), StoreError> {
        self.lock().remove(map);
        self.set_deletion(map, Some(record))
    }

    fn move_map(
        &self,
        map: &MapName,
        to: &MapName,
        _: &VersionVector,
        record: &DeletionRecord,
    ) -> Result<(), StoreError> {
        let mut maps = self.lock();
        if let Some(log) = maps.get(map).cloned() {
            maps.insert(to.clone(), log);
        }
        drop(maps);
        self.set_deletion(to, None)?;
        self.set_deletion(map, Some(record))
    }
}

impl LogReader for MemoryLog {
    fn deletions(&self) -> Result<BTreeMap<MapName, DeletionRecord>, StoreError> {
        Ok(self.lock_deletions().clone())
    }

    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        let maps = self.lock();
        let Some(log) = maps.get(map) else { return Ok(Stored::Absent) };
        let is_compacted = (1..=log.floor.vector.get(author)).contains(&number);
        Ok(match log.increments.get(&(author, number)) {
            Some(bytes) => Stored::Increment(bytes.clone()),
            None if is_compacted => Stored::Compacted,
            None => Stored::Absent,
        })
    }

    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        let maps = self.lock();
        let wanted = || maps.iter().filter(|(map, _)| of.is_none_or(|of| of == *map));
        for (map, log) in wanted() {
            for (&(author, last), bytes) in &log.compacted {
                visit(map.as_str(), author, last, Piece::Compacted(bytes))?;
            }
        }
        for (map, log) in wanted() {
            for (&(author, number), bytes) in &log.increments {
                visit(map.as_str(), author, number, Piece::Increment(bytes))?;
            }
        }
        Ok(())
    }

    fn for_each_lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        visit: &mut dyn FnMut(Piece<'_>) -> ControlFlow<()>,
    ) -> Result<(), StoreError> {
        let maps = self.lock();
        let Some(log) = maps.get(map) else { return Ok(()) };
        for (author, first, last) in gaps(have, upto) {
            let range = (author, first)..=(author, last);
            let compacted = log.compacted.range(range.clone()).map(|(_, bytes)| Piece::Compacted(bytes));
            let mut pieces = compacted.chain(log.increments.range(range).map(|(_, bytes)| Piece::Increment(bytes)));
            if pieces.any(|piece| visit(piece).is_break()) {
                break;
            }
        }
        Ok(())
    }

    fn vector_at(&self, map: &MapName, version: u64) -> Result<Option<VersionVector>, StoreError> {
        let maps = self.lock();
        let Some(log) = maps.get(map) else { return Ok(Some(VersionVector::default())) };
        let Some(after) = version.checked_sub(log.floor.version) else { return Ok(None) };
        let mut vector = log.floor.vector.clone();
        log.order.iter().take(usize::try_from(after).unwrap_or(usize::MAX)).for_each(|&(author, number)| {
            vector.set(author, number);
        });
        Ok(Some(vector))
    }

    fn floor(&self, map: &MapName) -> Result<CompactionFloor, StoreError> {
        Ok(self.lock().get(map).map(|log| log.floor.clone()).unwrap_or_default())
    }
}
