//! What one commit adds to the log and the catalog.

use crate::ingest::check::Checked;
use crate::ingest::refusals::RefusalNotice;
use crate::store::Record;
use fht_proto::{AuthorId, Increment, MapName};
use std::collections::{BTreeMap, BTreeSet};

/// What became of what one author has put into a map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WriterOutcome {
    /// Increments stored, those that waited for one of this batch, too.
    pub stored: u64,
    /// Increments refused.
    pub refused: u64,
}

/// What others should hear of a batch.
#[derive(Debug, Default)]
pub struct BatchOutcome {
    /// The maps whose heads the writers should see now: those that have grown, and those that were
    /// sent increments which they already had.
    pub announce: BTreeSet<MapName>,
    /// How much was stored and refused of whom. What waits for a gap to close, or was there before,
    /// is neither.
    pub written: BTreeMap<(MapName, AuthorId), WriterOutcome>,
    /// What writers are told about refused increments.
    pub notices: Vec<RefusalNotice>,
    /// What storages hold although another increment of that author and number is in the log.
    pub disputed: Vec<Checked>,
}

/// What one batch adds to the store.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub(super) records: Vec<Record>,
    /// Where each increment is among the records.
    pub(super) by_key: BTreeMap<(MapName, AuthorId, u64), usize>,
    pub(super) increments: BTreeMap<MapName, Vec<Increment>>,
    pub(super) added_bytes: BTreeMap<MapName, u64>,
    pub(super) refused: BTreeMap<MapName, u64>,
    pub(super) outcome: BatchOutcome,
}

impl Batch {
    /// Adds an increment that is next in its author's order; `sequence` is its place in the map's
    /// log.
    pub(super) fn add(&mut self, sequence: u64, item: Checked) {
        let Checked { map, increment, bytes, origin } = item;
        let (author, number) = (increment.author, increment.number);
        self.by_key.insert((map.clone(), author, number), self.records.len());
        *self.added_bytes.entry(map.clone()).or_default() += bytes.len() as u64;
        self.increments.entry(map.clone()).or_default().push(increment);
        self.outcome.announce.insert(map.clone());
        self.outcome.written.entry((map.clone(), author)).or_default().stored += 1;
        self.records.push(Record { map, sequence, author, number, bytes, origin });
    }
}
