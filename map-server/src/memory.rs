//! The log in memory: for a server whose increments are kept elsewhere, and for tests.

use crate::log::{Floor, FoldRecord, IncrementLog, Piece, Record, StoreError, Stored, Visit};
use fht_proto::{AuthorId, MapName, VersionVector};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

#[derive(Clone, Debug, Default)]
struct MapLog {
    increments: BTreeMap<(AuthorId, u64), Vec<u8>>,
    /// By author and last number.
    folds: BTreeMap<(AuthorId, u64), Vec<u8>>,
    /// The order in which they came, after the floor.
    order: Vec<(AuthorId, u64)>,
    floor: Floor,
}

/// A log that ends with the process.
#[derive(Debug, Default)]
pub struct MemoryLog {
    maps: Mutex<BTreeMap<MapName, MapLog>>,
}

impl MemoryLog {
    /// A log with nothing in it.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    // Whole operations under the lock: a panic in one is a bug, and leaves the others usable.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<MapName, MapLog>> {
        self.maps.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl IncrementLog for MemoryLog {
    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        let mut maps = self.lock();
        for record in records {
            let log = maps.entry(record.map.clone()).or_default();
            log.increments.insert((record.author, record.number), record.bytes.clone());
            log.order.push((record.author, record.number));
        }
        Ok(())
    }

    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        let maps = self.lock();
        let Some(log) = maps.get(map) else { return Ok(Stored::Absent) };
        let is_folded = (1..=log.floor.vector.get(author)).contains(&number);
        Ok(match log.increments.get(&(author, number)) {
            Some(bytes) => Stored::Increment(bytes.clone()),
            None if is_folded => Stored::Folded,
            None => Stored::Absent,
        })
    }

    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        let maps = self.lock();
        let wanted = || maps.iter().filter(|(map, _)| of.is_none_or(|of| of == *map));
        for (map, log) in wanted() {
            for (&(author, last), bytes) in &log.folds {
                visit(map.as_str(), author, last, Piece::Fold(bytes))?;
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
        for (author, last) in upto.iter() {
            let Some(first) = have.get(author).checked_add(1).filter(|&first| first <= last) else { continue };
            let range = (author, first)..=(author, last);
            let folds = log.folds.range(range.clone()).map(|(_, bytes)| Piece::Fold(bytes));
            let mut pieces = folds.chain(log.increments.range(range).map(|(_, bytes)| Piece::Increment(bytes)));
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

    fn floor(&self, map: &MapName) -> Result<Floor, StoreError> {
        Ok(self.lock().get(map).map(|log| log.floor.clone()).unwrap_or_default())
    }

    fn add_folds(&self, map: &MapName, floor: &Floor, folds: &[FoldRecord]) -> Result<(), StoreError> {
        let mut maps = self.lock();
        let log = maps.entry(map.clone()).or_default();
        log.folds.extend(folds.iter().map(|fold| ((fold.author, fold.last), fold.bytes.clone())));
        log.floor = floor.clone();
        Ok(())
    }

    fn replace_folded(&self, map: &MapName, floor: &Floor, folds: &[FoldRecord]) -> Result<(), StoreError> {
        let mut maps = self.lock();
        let log = maps.entry(map.clone()).or_default();
        let is_folded = |author: AuthorId, number: u64| number <= floor.vector.get(author);
        log.increments.retain(|&(author, number), _| !is_folded(author, number));
        log.folds.retain(|&(author, last), _| !is_folded(author, last));
        log.folds.extend(folds.iter().map(|fold| ((fold.author, fold.last), fold.bytes.clone())));
        let dropped = usize::try_from(floor.version.saturating_sub(log.floor.version)).unwrap_or(usize::MAX);
        log.order.drain(..dropped.min(log.order.len()));
        log.floor = floor.clone();
        Ok(())
    }
}
