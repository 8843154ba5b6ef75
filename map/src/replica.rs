//! Which increments have come. A state at a version vector is the join of each author's first so many increments, so
//! increments are applied in each author's order; early ones wait in a bounded buffer.

use crate::state::MapState;
use fht_proto::{AuthorId, Increment, VersionVector};
use std::collections::BTreeMap;

/// What became of an increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Accepted {
    /// It was applied, and with it early ones that had waited for it: how many in all.
    Applied(usize),
    /// It had come before.
    Duplicate,
    /// Others of its author are missing before it; it waits.
    Early,
    /// It is too early to wait: the buffer is full. It will have to be sent again.
    TooEarly,
}

/// A copy of a map that knows what it has.
#[derive(Clone, Debug, Default)]
pub struct Replica {
    state: MapState,
    vector: VersionVector,
    early: BTreeMap<(AuthorId, u64), Increment>,
}

impl Replica {
    /// Most increments that wait for others.
    pub const MAX_EARLY: usize = 4096;

    /// An empty copy.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The map.
    #[must_use]
    pub fn state(&self) -> &MapState {
        &self.state
    }

    /// What the map contains.
    #[must_use]
    pub fn vector(&self) -> &VersionVector {
        &self.vector
    }

    /// Takes an increment in.
    pub fn accept(&mut self, increment: Increment) -> Accepted {
        let author = increment.author;
        let next = self.vector.get(author) + 1;
        if increment.number < next || self.early.contains_key(&(author, increment.number)) {
            return Accepted::Duplicate;
        }
        if increment.number > next {
            if self.early.len() >= Self::MAX_EARLY {
                return Accepted::TooEarly;
            }
            self.early.insert((author, increment.number), increment);
            return Accepted::Early;
        }
        let mut applied = 0;
        let mut current = Some(increment);
        while let Some(increment) = current {
            self.state.apply(&increment);
            self.vector.set(author, increment.number);
            applied += 1;
            current = self.early.remove(&(author, increment.number + 1));
        }
        Accepted::Applied(applied)
    }
}
