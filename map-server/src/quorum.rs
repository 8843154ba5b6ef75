//! The log of a server that keeps nothing itself: memory, and storages elsewhere. What is appended is durable when enough of them have
//! said that they hold it.

use crate::check::{Arrival, Checked, check};
use crate::config::Limits;
use crate::log::{Floor, FoldRecord, IncrementLog, Origin, Piece, Record, StoreError, Stored, Visit};
use crate::memory::MemoryLog;
use crate::storages::{Place, QuorumConfig, Storages, stands_before};
use fht_proto::keys::Key;
use fht_proto::{AuthorId, MapName, VersionVector};
use std::ops::ControlFlow;
use std::sync::Arc;

/// An increment that is not confirmed is put again after so many questions, and after as many again.
const PUT_AGAIN_AFTER: u32 = 6;

/// The log.
#[derive(Debug)]
pub struct QuorumLog {
    memory: MemoryLog,
    storages: Arc<dyn Storages>,
    config: QuorumConfig,
}

fn place(record: &Record) -> Place {
    Place { map: record.map.clone(), author: record.author, number: record.number }
}

/// Whether `bytes` are an increment that a server would let in at a place.
fn belongs(place: &Place, bytes: &[u8]) -> bool {
    let key = Key::kept(&place.map, place.author, place.number).to_string();
    check(Arrival { key, payload: Ok(bytes.to_vec()) }, &Limits::default(), 0).is_ok()
}

impl QuorumLog {
    /// A log with nothing in it, on top of `storages`.
    #[must_use]
    pub fn new(storages: Arc<dyn Storages>, config: QuorumConfig) -> Self {
        Self { memory: MemoryLog::new(), storages, config }
    }

    /// Has the storages hold all of `records`, and waits until enough of them say so.
    ///
    /// They are asked before anything is put: what is there already may have been acknowledged, and stays. Still, two servers may let in
    /// two increments of one number at one time: of two robots of one name, or of one that failed and came back. Everybody then agrees on the
    /// later, or on the one whose bytes are less ([`stands_before`]).
    fn keep(&self, records: &[Record]) -> Result<(), StoreError> {
        let is_open = |record: &&Record| match record.origin {
            Origin::Writer => true,
            Origin::Storages { copies } => copies < self.config.confirm,
        };
        let mut open: Vec<&Record> = records.iter().filter(is_open).collect();
        for attempt in 0.. {
            if open.is_empty() {
                return Ok(());
            }
            let is_due = |record: &&&Record| match record.origin {
                Origin::Writer => attempt % PUT_AGAIN_AFTER == 1,
                // The server that put it is trusted to have done so.
                Origin::Storages { .. } => attempt > 1 && attempt % PUT_AGAIN_AFTER == 1,
            };
            open.iter().filter(is_due).for_each(|record| self.storages.put(&place(record), &record.bytes));
            open = self.unconfirmed(open, attempt == 0)?;
            if attempt > 0 && !open.is_empty() && !self.storages.pause(attempt - 1) {
                break;
            }
        }
        Err(StoreError::Unconfirmed)
    }

    /// Those of `records` that are not held by enough storages yet; `is_first`: this server has put none of them.
    fn unconfirmed<'a>(&self, records: Vec<&'a Record>, is_first: bool) -> Result<Vec<&'a Record>, StoreError> {
        let places: Vec<Place> = records.iter().map(|record| place(record)).collect();
        let held = self.storages.held(&places, self.config.confirm);
        let mut unconfirmed = Vec::new();
        for ((record, place), held) in records.into_iter().zip(places).zip(held) {
            if held.copies(&record.bytes) >= self.config.confirm {
                continue;
            }
            let stands = |other: &[u8]| match record.origin {
                Origin::Writer if is_first => other != record.bytes,
                _ => stands_before(other, &record.bytes),
            };
            if held.payloads().any(|other| stands(other) && belongs(&place, other)) {
                let Place { map, author, number } = place;
                return Err(StoreError::Overruled { map, author, number });
            }
            unconfirmed.push(record);
        }
        Ok(unconfirmed)
    }
}

/// Storages keep what is not what `log` has: if theirs stands before it, this server gives way, else they get what it has.
///
/// # Errors
/// [`StoreError::Overruled`] when this server has to give way: it reads everything anew.
pub fn settle(disputed: &[Checked], log: &dyn IncrementLog, storages: &dyn Storages) -> Result<(), StoreError> {
    for theirs in disputed {
        let (map, author, number) = (theirs.map.clone(), theirs.increment.author, theirs.increment.number);
        let Stored::Increment(ours) = log.stored(&map, author, number)? else { continue };
        if stands_before(&theirs.bytes, &ours) {
            return Err(StoreError::Overruled { map, author, number });
        }
        storages.put(&Place { map, author, number }, &ours);
    }
    Ok(())
}

impl IncrementLog for QuorumLog {
    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        self.keep(records)?;
        self.memory.append(records)
    }

    fn is_shared(&self) -> bool {
        true
    }

    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        self.memory.stored(map, author, number)
    }

    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        self.memory.for_each(of, visit)
    }

    fn for_each_lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        visit: &mut dyn FnMut(Piece<'_>) -> ControlFlow<()>,
    ) -> Result<(), StoreError> {
        self.memory.for_each_lacking(map, have, upto, visit)
    }

    fn vector_at(&self, map: &MapName, version: u64) -> Result<Option<VersionVector>, StoreError> {
        self.memory.vector_at(map, version)
    }

    fn floor(&self, map: &MapName) -> Result<Floor, StoreError> {
        self.memory.floor(map)
    }

    fn add_folds(&self, map: &MapName, _: &Floor, _: &[FoldRecord]) -> Result<(), StoreError> {
        Err(no_folds(map))
    }

    fn replace_folded(&self, map: &MapName, _: &Floor, _: &[FoldRecord]) -> Result<(), StoreError> {
        Err(no_folds(map))
    }
}

/// Those who fold ask [`IncrementLog::is_shared`] before.
fn no_folds(map: &MapName) -> StoreError {
    StoreError::Damaged { map: map.to_string(), reason: "a log that others share was to be folded".to_owned() }
}
