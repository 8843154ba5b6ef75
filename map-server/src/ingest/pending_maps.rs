//! Increments that arrived before the first of their map. Anybody can invent names of maps, so all
//! of them share one small buffer, and none of them counts as a map.

use crate::ingest::check::Checked;
use fht_map::crdt::reorder_buffer::{Offered, ReorderBuffer, SequenceConfig};
use fht_proto::{Increment, MapName, VersionVector};
use std::collections::BTreeMap;

/// The shared buffer.
#[derive(Debug)]
pub struct PendingMaps {
    early: SequenceConfig,
    max_bytes: usize,
    bytes: usize,
    maps: BTreeMap<MapName, ReorderBuffer<Checked>>,
}

impl PendingMaps {
    /// A buffer of `max_bytes` of memory; `early` limits what may wait for one map.
    #[must_use]
    pub fn new(early: SequenceConfig, max_bytes: usize) -> Self {
        Self { early, max_bytes, bytes: 0, maps: BTreeMap::new() }
    }

    /// Keeps an increment that is not its author's first. A full buffer is emptied: inventing names
    /// cannot keep it full, and honest writers send again.
    pub fn keep(&mut self, checked: Checked) -> Offered<Checked> {
        let bytes = checked.memory_bytes();
        if bytes > self.max_bytes {
            return Offered::Dropped;
        }
        if self.bytes + bytes > self.max_bytes {
            self.maps.clear();
            self.bytes = 0;
        }
        let early = &self.early;
        let sequence = self
            .maps
            .entry(checked.map.clone())
            .or_insert_with(|| ReorderBuffer::starting_at(VersionVector::default(), early.clone()));
        let before = sequence.waiting_bytes();
        let Increment { author, number, hlc_us, .. } = checked.increment;
        let offered = sequence.offer(author, number, hlc_us, bytes, checked);
        // It may have replaced another increment.
        self.bytes = self.bytes + sequence.waiting_bytes() - before;
        offered
    }

    /// What waits for a map.
    #[must_use]
    pub fn of_map(&self, map: &MapName) -> Option<&ReorderBuffer<Checked>> {
        self.maps.get(map)
    }

    /// Takes out what has waited for a map, which now begins.
    pub fn take_map(&mut self, map: &MapName) -> ReorderBuffer<Checked> {
        match self.maps.remove(map) {
            Some(sequence) => {
                self.bytes -= sequence.waiting_bytes();
                sequence
            }
            None => ReorderBuffer::starting_at(VersionVector::default(), self.early.clone()),
        }
    }
}
