//! Increments that came before the first of their map. Names of maps are free to invent, so all of them share one small room, and
//! nothing here counts as a map.

use crate::check::Checked;
use fht_map::sequence::{Offered, Sequence, SequenceConfig};
use fht_proto::{Increment, MapName, VersionVector};
use std::collections::BTreeMap;

/// The shared room.
#[derive(Debug)]
pub struct Nursery {
    early: SequenceConfig,
    max_bytes: usize,
    bytes: usize,
    maps: BTreeMap<MapName, Sequence<Checked>>,
}

impl Nursery {
    /// A room of `max_bytes` of memory; `early` is what may wait for one map.
    #[must_use]
    pub fn new(early: SequenceConfig, max_bytes: usize) -> Self {
        Self { early, max_bytes, bytes: 0, maps: BTreeMap::new() }
    }

    /// Keeps an increment that is not its author's first. When the room is full it is emptied: who invents names cannot keep
    /// it full, and honest writers send again.
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
            .or_insert_with(|| Sequence::starting_at(VersionVector::default(), early.clone()));
        let before = sequence.waiting_bytes();
        let Increment { author, number, hlc_us, .. } = checked.increment;
        let offered = sequence.offer(author, number, hlc_us, bytes, checked);
        // It may have taken another one's place.
        self.bytes = self.bytes + sequence.waiting_bytes() - before;
        offered
    }

    /// The map begins: what has waited for it, taken out.
    pub fn take(&mut self, map: &MapName) -> Sequence<Checked> {
        match self.maps.remove(map) {
            Some(sequence) => {
                self.bytes -= sequence.waiting_bytes();
                sequence
            }
            None => Sequence::starting_at(VersionVector::default(), self.early.clone()),
        }
    }
}
