//! What the writer knows about a map: what has come in order, and how much is there for whom.

use crate::catalog::{AddedElements, MapView};
use crate::ingest::check::Checked;
use crate::store::{IncrementLog, StoreError};
use fht_map::crdt::reorder_buffer::{ReorderBuffer, SequenceConfig};
use fht_proto::{AuthorId, Increment, MapName};
use std::collections::BTreeMap;

/// What of a map is there for one author.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct WriterUse {
    pub(super) bytes: u64,
    pub(super) elements: usize,
}

impl WriterUse {
    pub(super) fn add(&mut self, bytes: u64, elements: usize) {
        self.bytes += bytes;
        self.elements += elements;
    }
}

/// What the writer knows about one map.
#[derive(Debug)]
pub(super) struct Intake {
    pub(super) sequence: ReorderBuffer<Checked>,
    pub(super) bytes: u64,
    /// An upper bound of what the map has.
    pub(super) elements: usize,
    /// What of both is there for whom. Without roles only what has come since the start.
    pub(super) by_author: BTreeMap<AuthorId, WriterUse>,
}

impl Intake {
    /// Where a map is. Nobody is counted yet.
    pub(super) fn of(view: &MapView, early: &SequenceConfig) -> Self {
        Self {
            sequence: ReorderBuffer::starting_at(view.head.vector.clone(), early.clone()),
            bytes: view.head.bytes,
            elements: view.state.elements(),
            by_author: BTreeMap::new(),
        }
    }

    /// What was added is durable, and counted.
    pub(super) fn added(&mut self, added: &AddedElements, increments: &[Increment]) {
        self.elements = added.total;
        for ((author, elements), increment) in added.by_author.iter().zip(increments) {
            let own = self.by_author.entry(*author).or_default();
            // It was counted by its operations.
            own.elements = (own.elements + elements).saturating_sub(increment.ops.len());
        }
    }

    /// Counts again how many bytes are there for whom.
    pub(super) fn recount_bytes(&mut self, map: &MapName, log: &dyn IncrementLog) -> Result<(), StoreError> {
        self.by_author.values_mut().for_each(|own| own.bytes = 0);
        log.reader().for_each(Some(map), &mut |_, author, _, piece| {
            self.by_author.entry(author).or_default().bytes += piece.bytes().len() as u64;
            Ok(())
        })
    }
}
