//! The explorer's own log: operations become numbered, stamped increments and are applied to its own map at once.

use fht_map::MapState;
use fht_proto::{AuthorId, Increment, NodeId, Op};

/// The map as the explorer has written it so far.
pub struct Journal {
    author: AuthorId,
    written: u64,
    next_node: u32,
    clock_us: u64,
    state: MapState,
}

impl Journal {
    /// An empty map.
    #[must_use]
    pub fn new(author: AuthorId) -> Self {
        Self { author, written: 0, next_node: 0, clock_us: 0, state: MapState::new() }
    }

    /// Who writes.
    #[must_use]
    pub fn author(&self) -> AuthorId {
        self.author
    }

    /// Number of the newest increment, 0 before the first.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.written
    }

    /// The map.
    #[must_use]
    pub fn state(&self) -> &MapState {
        &self.state
    }

    /// The id that [`Journal::fresh_node`] gives next.
    #[must_use]
    pub fn next_node(&self) -> NodeId {
        NodeId { author: self.author, number: self.next_node }
    }

    /// A node id that was never used.
    pub fn fresh_node(&mut self) -> NodeId {
        let id = self.next_node();
        self.next_node += 1;
        id
    }

    /// Writes `ops` as one increment, stamped with the sensors' time `time_us`; `None` if there are none.
    pub fn write(&mut self, ops: Vec<Op>, time_us: u64) -> Option<Increment> {
        if ops.is_empty() {
            return None;
        }
        // Hybrid logical clock: physical time, pushed past everything seen.
        self.clock_us = time_us.max(self.clock_us + 1).max(self.state.max_hlc_us() + 1);
        self.written += 1;
        let increment = Increment { author: self.author, number: self.written, hlc_us: self.clock_us, ops };
        self.state.apply(&increment);
        Some(increment)
    }
}
