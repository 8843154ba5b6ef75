//! The log of a server that keeps nothing itself: memory in front of storages elsewhere. What is
//! appended is durable when enough storages have confirmed that they hold it.

use crate::config::{Limits, QuorumConfig};
use crate::ingest::{Arrival, Checked, check};
use crate::replicated::storages::{IncrementKey, Storages, stands_before};
use crate::store::{
    CompactedRecord, CompactionFloor, IncrementLog, IncrementOrigin, LogReader, MemoryLog, Record, StoreError, Stored,
};
use fht_proto::MapName;
use fht_proto::api::keys::Key;
use std::sync::Arc;

/// An unconfirmed increment is put again after so many questions.
const PUT_AGAIN_AFTER: u32 = 6;
/// After so many, some seconds, it is said that too few storages answer.
const SAID_AFTER: u32 = 10;

/// The log.
#[derive(Debug)]
pub struct QuorumLog {
    memory: MemoryLog,
    storages: Arc<dyn Storages>,
    config: QuorumConfig,
}

fn place(record: &Record) -> IncrementKey {
    IncrementKey { map: record.map.clone(), author: record.author, number: record.number }
}

/// Whether `bytes` are an increment that a server would accept at a place.
fn belongs(place: &IncrementKey, bytes: &[u8]) -> bool {
    let key = Key::kept(&place.map, place.author, place.number).to_string();
    check(Arrival { key, payload: Ok(bytes.to_vec()) }, &Limits::default()).is_ok()
}

impl QuorumLog {
    /// An empty log in front of `storages`.
    #[must_use]
    pub fn new(storages: Arc<dyn Storages>, config: QuorumConfig) -> Self {
        Self { memory: MemoryLog::new(), storages, config }
    }

    /// Has the storages hold all of `records`, and waits until enough of them confirm it.
    ///
    /// The storages are asked before anything is put: what is already there may have been
    /// acknowledged, and stays. Two servers may still accept two increments of the same number at
    /// the same time: from two robots of one name, or from one that failed and came back. All
    /// servers then agree on the later one, or on the one whose bytes compare less
    /// ([`stands_before`]).
    fn keep(&self, records: &[Record]) -> Result<(), StoreError> {
        let is_open = |record: &&Record| match record.origin {
            IncrementOrigin::Writer => true,
            IncrementOrigin::Storages { copies } => copies < self.config.confirm,
        };
        let mut open: Vec<&Record> = records.iter().filter(is_open).collect();
        for attempt in 0.. {
            if open.is_empty() {
                return Ok(());
            }
            let is_due = |record: &&&Record| match record.origin {
                IncrementOrigin::Writer => attempt % PUT_AGAIN_AFTER == 1,
                // The server that put it is trusted to have done so.
                IncrementOrigin::Storages { .. } => attempt > 1 && attempt % PUT_AGAIN_AFTER == 1,
            };
            open.iter().filter(is_due).for_each(|record| self.storages.put(&place(record), &record.bytes));
            open = self.unconfirmed(open, attempt == 0)?;
            if attempt == SAID_AFTER && !open.is_empty() {
                let (count, confirm) = (open.len(), self.config.confirm);
                tracing::warn!(
                    "{count} increments wait for {confirm} storages to hold them: do the routers with storages answer?"
                );
            }
            if attempt > 0 && !open.is_empty() && !self.storages.pause(attempt - 1) {
                break;
            }
        }
        Err(StoreError::Unconfirmed)
    }

    /// The records that too few storages hold so far; `is_first`: this server has put none of them.
    fn unconfirmed<'a>(&self, records: Vec<&'a Record>, is_first: bool) -> Result<Vec<&'a Record>, StoreError> {
        let places: Vec<IncrementKey> = records.iter().map(|record| place(record)).collect();
        let held = self.storages.held(&places, self.config.confirm);
        let mut unconfirmed = Vec::new();
        for ((record, place), held) in records.into_iter().zip(places).zip(held) {
            if held.copies(&record.bytes) >= self.config.confirm {
                continue;
            }
            let stands = |other: &[u8]| match record.origin {
                IncrementOrigin::Writer if is_first => other != record.bytes,
                _ => stands_before(other, &record.bytes),
            };
            if held.payloads().any(|other| stands(other) && belongs(&place, other)) {
                let IncrementKey { map, author, number } = place;
                return Err(StoreError::Overruled { map, author, number });
            }
            unconfirmed.push(record);
        }
        Ok(unconfirmed)
    }
}

/// Storages hold something other than `log`: if theirs stands before it, this server gives way;
/// otherwise they get what it has.
///
/// # Errors
/// [`StoreError::Overruled`] when this server has to give way: it reads everything anew.
pub fn settle_disputed(
    disputed: &[Checked],
    log: &dyn IncrementLog,
    storages: &dyn Storages,
) -> Result<(), StoreError> {
    for theirs in disputed {
        let (map, author, number) = (theirs.map.clone(), theirs.increment.author, theirs.increment.number);
        let Stored::Increment(ours) = log.reader().stored(&map, author, number)? else { continue };
        if stands_before(&theirs.bytes, &ours) {
            return Err(StoreError::Overruled { map, author, number });
        }
        storages.put(&IncrementKey { map, author, number }, &ours);
    }
    Ok(())
}

impl IncrementLog for QuorumLog {
    fn reader(&self) -> &dyn LogReader {
        &self.memory
    }

    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        self.keep(records)?;
        self.memory.append(records)
    }

    fn is_shared(&self) -> bool {
        true
    }

    fn add_compacted(&self, map: &MapName, _: &CompactionFloor, _: &[CompactedRecord]) -> Result<(), StoreError> {
        Err(no_compaction(map))
    }

    fn replace_compacted(&self, map: &MapName, _: &CompactionFloor, _: &[CompactedRecord]) -> Result<(), StoreError> {
        Err(no_compaction(map))
    }
}

/// Callers of compaction ask [`IncrementLog::is_shared`] first.
fn no_compaction(map: &MapName) -> StoreError {
    StoreError::Damaged { map: map.to_string(), reason: "a log that others share was to be folded".to_owned() }
}
