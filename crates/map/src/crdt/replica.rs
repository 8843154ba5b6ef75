//! A copy of a map that takes increments as the network delivers them: late, twice, out of order.

use crate::crdt::register::{ContentHash, content_hash};
use crate::crdt::reorder_buffer::{Offered, ReorderBuffer, SequenceConfig};
use crate::crdt::state::MapState;
use fht_proto::{AuthorId, CompactedSeries, Increment, VersionVector};
use std::collections::BTreeMap;

/// What became of an increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// It was applied, together with increments that had waited for it: so many in all.
    Applied(usize),
    /// It was applied or kept before.
    Duplicate,
    /// It is kept until the gap before it closes.
    Early,
    /// Another increment of this author and number is already there: one of the two is forged, or
    /// the author has lost its memory. The first one stays.
    Conflict,
    /// It is too far ahead to be kept.
    Dropped,
}

/// An increment with the hash of its content.
#[derive(Clone, Debug)]
struct Hashed {
    hash: ContentHash,
    increment: Increment,
}

impl PartialEq for Hashed {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash
    }
}

/// A map together with what it consists of: for each author the increments 1 to n without a gap.
#[derive(Clone, Debug)]
pub struct Replica {
    state: MapState,
    sequence: ReorderBuffer<Hashed>,
    // What tells a repetition from a conflict.
    applied: BTreeMap<AuthorId, Applied>,
}

/// Hashes of what was applied of one author.
#[derive(Clone, Debug, Default)]
struct Applied {
    /// How many came as folds before the first one hashed: of those only the rest is known.
    folded: u64,
    /// Those after them, by number.
    hashes: Vec<ContentHash>,
}

impl Default for Replica {
    fn default() -> Self {
        Self::new(SequenceConfig::default())
    }
}

impl Replica {
    /// The empty map.
    #[must_use]
    pub fn new(config: SequenceConfig) -> Self {
        let sequence = ReorderBuffer::starting_at(VersionVector::default(), config);
        Self { state: MapState::new(), sequence, applied: BTreeMap::new() }
    }

    /// The map as it stands.
    #[must_use]
    pub fn state(&self) -> &MapState {
        &self.state
    }

    /// What the map consists of.
    #[must_use]
    pub fn vector(&self) -> &VersionVector {
        self.sequence.vector()
    }

    /// How many early increments are kept until the gaps before them close.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.sequence.waiting()
    }

    /// Takes an increment that has passed validation (everything from [`fht_proto::decode`] has).
    pub fn accept(&mut self, increment: Increment) -> Accepted {
        let (author, number, stamp_us) = (increment.author, increment.number, increment.hlc_us);
        let hash = content_hash(&increment);
        let bytes = increment.memory_bytes();
        let waited = self.sequence.waiting();
        match self.sequence.offer(author, number, stamp_us, bytes, Hashed { hash, increment }) {
            Offered::Ready(ready) => {
                self.apply(author, &ready);
                Accepted::Applied(ready.len())
            }
            Offered::Past => self.compare_with_applied(author, number, hash),
            Offered::Waiting if self.sequence.waiting() == waited => Accepted::Duplicate,
            Offered::Waiting => Accepted::Early,
            Offered::Conflict => Accepted::Conflict,
            Offered::Dropped => Accepted::Dropped,
        }
    }

    /// Takes what is left of old increments (everything from [`fht_proto::decode`] has passed
    /// validation). It is applied if it goes on where its author's sequence is, or overlaps it;
    /// otherwise it is dropped, to be asked for again.
    pub fn accept_fold(&mut self, fold: &CompactedSeries) -> Accepted {
        let have = self.vector().get(fold.author);
        if fold.last <= have {
            return Accepted::Duplicate;
        }
        if fold.first > have + 1 {
            return Accepted::Dropped;
        }
        self.state.apply_fold(fold);
        let applied = self.applied.entry(fold.author).or_default();
        *applied = Applied { folded: fold.last, hashes: Vec::new() };
        let ready = self.sequence.skip(fold.author, fold.last);
        self.apply(fold.author, &ready);
        Accepted::Applied(usize::try_from(fold.last - have).unwrap_or(usize::MAX).saturating_add(ready.len()))
    }

    fn apply(&mut self, author: AuthorId, ready: &[Hashed]) {
        let applied = self.applied.entry(author).or_default();
        for item in ready {
            self.state.apply(&item.increment);
            applied.hashes.push(item.hash);
        }
    }

    fn compare_with_applied(&self, author: AuthorId, number: u64, hash: ContentHash) -> Accepted {
        let Some(applied) = self.applied.get(&author).filter(|_| number >= 1) else { return Accepted::Conflict };
        let Some(behind) = number.checked_sub(applied.folded + 1) else { return Accepted::Duplicate };
        let known = usize::try_from(behind).ok().and_then(|index| applied.hashes.get(index));
        if known == Some(&hash) { Accepted::Duplicate } else { Accepted::Conflict }
    }
}
