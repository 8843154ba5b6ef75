//! A copy of a map that is fed increments as the network brings them: late, twice, out of order.

use crate::register::{ContentHash, content_hash};
use crate::sequence::{Offered, Sequence, SequenceConfig};
use crate::state::MapState;
use fht_proto::{AuthorId, Increment, VersionVector};
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
    /// Another increment of this author and number is already there: one of the two is forged, or the author has lost its
    /// memory. The first one stays.
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
    sequence: Sequence<Hashed>,
    // Hashes of what was applied, by author and number - 1: what tells a repetition from a conflict.
    applied: BTreeMap<AuthorId, Vec<ContentHash>>,
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
        let sequence = Sequence::starting_at(VersionVector::default(), config);
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
        let (author, number) = (increment.author, increment.number);
        let hash = content_hash(&increment);
        let bytes = increment.memory_bytes();
        let waited = self.sequence.waiting();
        match self.sequence.offer(author, number, bytes, Hashed { hash, increment }) {
            Offered::Ready(ready) => {
                let hashes = self.applied.entry(author).or_default();
                for item in &ready {
                    self.state.apply(&item.increment);
                    hashes.push(item.hash);
                }
                Accepted::Applied(ready.len())
            }
            Offered::Past => self.compare_with_applied(author, number, hash),
            Offered::Waiting if self.sequence.waiting() == waited => Accepted::Duplicate,
            Offered::Waiting => Accepted::Early,
            Offered::Conflict => Accepted::Conflict,
            Offered::Dropped => Accepted::Dropped,
        }
    }

    fn compare_with_applied(&self, author: AuthorId, number: u64, hash: ContentHash) -> Accepted {
        let index = usize::try_from(number.saturating_sub(1)).ok();
        let applied = index.and_then(|index| self.applied.get(&author)?.get(index));
        if number >= 1 && applied == Some(&hash) { Accepted::Duplicate } else { Accepted::Conflict }
    }
}
