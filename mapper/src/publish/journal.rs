//! The explorer's own log: operations become numbered, stamped increments and are applied to its
//! own map at once. In a map that others write, too, the log follows what they write.

use fht_map::MapState;
use fht_proto::{AuthorId, Increment, NodeId, Op};
use std::collections::VecDeque;

/// The map as the explorer has written it so far, and as others have if it is shared.
pub struct Journal {
    author: AuthorId,
    written: u64,
    next_node: u32,
    clock_us: u64,
    state: MapState,
    /// In a map that is shared: what the server may not have yet.
    pending: Option<VecDeque<Increment>>,
    /// Whether an earlier run may have put increments that nobody has, under the numbers that come
    /// now.
    has_forerunner: bool,
    /// What the clock on the wall said when the run began, microseconds since 1970.
    began_us: u64,
}

/// So much later than the map are the stamps of a run that goes on where another one ended, if its
/// sensors' time does not say so, microseconds: later than those of what that one has put in vain.
/// But not later than the clock on the wall, or a robot that begins again and again would be
/// refused for stamps from the future.
const AFTER_FORERUNNER_US: u64 = 600_000_000;

impl Journal {
    /// An empty map.
    #[must_use]
    pub fn new(author: AuthorId) -> Self {
        Self {
            author,
            written: 0,
            next_node: 0,
            clock_us: 0,
            state: MapState::new(),
            pending: None,
            has_forerunner: false,
            began_us: u64::MAX,
        }
    }

    /// Says what the clock on the wall showed when the run began, microseconds since 1970.
    pub fn set_began(&mut self, wall_us: u64) {
        self.began_us = wall_us;
    }

    /// From now on the map is shared: what is written is kept until [`Journal::follow`] says that
    /// the server has it.
    pub fn share(&mut self) {
        self.pending.get_or_insert_default();
    }

    /// Goes on where an earlier run of the same author ended, who has written `written` increments
    /// of the map `shared`.
    pub fn resume(&mut self, shared: &MapState, written: u64) {
        self.share();
        self.state = shared.clone();
        self.written = self.written.max(written);
        self.has_forerunner = written > 0;
        self.next_node = self.next_node.max(shared.next_number(self.author));
    }

    /// The map is `shared` now, of which the server has this author's increments up to
    /// `acknowledged`. What was written since stays on top of it.
    pub fn follow(&mut self, shared: &MapState, acknowledged: u64) {
        let Some(pending) = &mut self.pending else { return };
        while pending.front().is_some_and(|first| first.number <= acknowledged) {
            pending.pop_front();
        }
        self.state = shared.clone();
        for increment in pending {
            self.state.apply(increment);
        }
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

    /// Writes `ops` as one increment, stamped with the sensors' time `time_us`; `None` if there are
    /// none.
    pub fn write(&mut self, ops: Vec<Op>, time_us: u64) -> Option<Increment> {
        if ops.is_empty() {
            return None;
        }
        // Hybrid logical clock: physical time, pushed past everything seen.
        let newest_us = self.state.max_hlc_us();
        let is_behind = std::mem::take(&mut self.has_forerunner) && time_us <= newest_us;
        let most_us = if is_behind { AFTER_FORERUNNER_US } else { 1 };
        let gap_us = most_us.min(self.began_us.saturating_sub(newest_us)).max(1);
        self.clock_us = time_us.max(self.clock_us + 1).max(newest_us + gap_us);
        self.written += 1;
        let increment = Increment { author: self.author, number: self.written, hlc_us: self.clock_us, ops };
        self.state.apply(&increment);
        if let Some(pending) = &mut self.pending {
            pending.push_back(increment.clone());
        }
        Some(increment)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{FixedPose, NodeKind};

    #[test]
    fn who_begins_again_and_again_does_not_run_ahead_of_the_clock_on_the_wall() {
        const WALL_US: u64 = 1_795_000_000_000_000;
        let author = AuthorId(7);
        let ops = |id| vec![Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose::default() }];
        // An operator's stamps are those of the wall; a run of this robot is there already.
        let mut shared = MapState::new();
        shared.apply(&Increment {
            author: AuthorId(1),
            number: 1,
            hlc_us: WALL_US,
            ops: ops(NodeId { author, number: 0 }),
        });
        let begin = |shared: &MapState, written: u64, wall_us: u64| {
            let mut journal = Journal::new(author);
            journal.set_began(wall_us);
            journal.resume(shared, written);
            let id = journal.fresh_node();
            journal.write(ops(id), 1_000_000).unwrap()
        };
        let mut newest_us = WALL_US;
        for run in 1..=100 {
            let wall_us = WALL_US + run * 1_000_000;
            let first = begin(&shared, run, wall_us);
            assert!(first.hlc_us > newest_us && first.hlc_us <= wall_us, "run {run}: {}", first.hlc_us);
            newest_us = first.hlc_us;
            shared.apply(&first);
        }
        // While the map is of simulated time, what the run before had put in vain is left behind.
        let mut simulated = MapState::new();
        simulated.apply(&Increment { author, number: 1, hlc_us: 5_000_000, ops: ops(NodeId { author, number: 0 }) });
        assert_eq!(begin(&simulated, 1, WALL_US).hlc_us, 5_000_000 + AFTER_FORERUNNER_US);
    }
}
