//! Puts each author's numbered increments in order. It passes on what continues the author's
//! sequence without a gap, and keeps early increments within bounds. What it drops for lack of room
//! is not lost: writers send again what the server's head does not cover, and replicas ask for it.
//!
//! A writer that failed and came back continues after what its server has, so it may reuse numbers
//! that it had put in vain. Its new stamps are later. Of two increments that wait under one number
//! the later one stays; what waits behind a later one is from the run before, and is dropped.

use fht_proto::{AuthorId, VersionVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How much may wait for a gap to close.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SequenceConfig {
    /// How far ahead of its author's sequence a number may be. Default 4096.
    pub max_ahead: u64,
    /// Bytes that may wait, all authors together. Default 32 MiB.
    pub max_waiting_bytes: usize,
}

impl Default for SequenceConfig {
    fn default() -> Self {
        Self { max_ahead: 4096, max_waiting_bytes: 32 << 20 }
    }
}

/// What became of an offered item.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Offered<T> {
    /// It continues its author's sequence: these are next, in order, the offered one first.
    Ready(Vec<T>),
    /// A number that was passed on before.
    Past,
    /// It waits for the numbers before it.
    Waiting,
    /// A different item of this author, number and stamp is already waiting; the offered one was
    /// dropped.
    Conflict,
    /// Too far ahead, or no room, or a later one waits in its place; it was dropped.
    Dropped,
}

#[derive(Clone, Debug)]
struct Waiting<T> {
    stamp_us: u64,
    bytes: usize,
    item: T,
}

/// The sequences of all authors of one map.
#[derive(Clone, Debug)]
pub struct ReorderBuffer<T> {
    config: SequenceConfig,
    vector: VersionVector,
    waiting: BTreeMap<(AuthorId, u64), Waiting<T>>,
    waiting_bytes: usize,
}

impl<T: PartialEq> ReorderBuffer<T> {
    /// Sequences that have passed on everything up to `vector`.
    #[must_use]
    pub fn starting_at(vector: VersionVector, config: SequenceConfig) -> Self {
        Self { config, vector, waiting: BTreeMap::new(), waiting_bytes: 0 }
    }

    /// What was passed on, per author.
    #[must_use]
    pub fn vector(&self) -> &VersionVector {
        &self.vector
    }

    /// How many items wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// What waits of one author, in order.
    pub fn waiting_of(&self, author: AuthorId) -> impl Iterator<Item = &T> {
        self.waiting.range((author, 0)..=(author, u64::MAX)).map(|(_, waiting)| &waiting.item)
    }

    /// Bytes that wait, as they were offered.
    #[must_use]
    pub fn waiting_bytes(&self) -> usize {
        self.waiting_bytes
    }

    /// Offers item `number` (from 1) of `author`, stamped `stamp_us`, which takes up `bytes`.
    pub fn offer(&mut self, author: AuthorId, number: u64, stamp_us: u64, bytes: usize, item: T) -> Offered<T> {
        let passed = self.vector.get(author);
        if number <= passed {
            return Offered::Past;
        }
        if number > passed + 1 {
            return self.keep(author, number, Waiting { stamp_us, bytes, item });
        }
        let mut ready = vec![item];
        // The one that waited under this number, if any, gives way.
        self.take(author, number);
        ready.extend(self.follow(author, number, stamp_us));
        Offered::Ready(ready)
    }

    /// Everything of `author` up to `last` has come another way. Returns what is next, in order, of
    /// what waited.
    pub fn skip(&mut self, author: AuthorId, last: u64) -> Vec<T> {
        if last <= self.vector.get(author) {
            return Vec::new();
        }
        while let Some(&(_, number)) = self.waiting.range((author, 0)..=(author, last)).next().map(|(key, _)| key) {
            self.take(author, number);
        }
        self.follow(author, last, 0)
    }

    /// What waited behind `last`, which was passed on, and is not older than it.
    fn follow(&mut self, author: AuthorId, mut last: u64, mut stamp_us: u64) -> Vec<T> {
        let mut ready = Vec::new();
        while let Some(next) = last.checked_add(1).and_then(|next| self.take(author, next)) {
            if next.stamp_us < stamp_us {
                break;
            }
            stamp_us = next.stamp_us;
            ready.push(next.item);
            last += 1;
        }
        self.vector.set(author, last);
        ready
    }

    fn take(&mut self, author: AuthorId, number: u64) -> Option<Waiting<T>> {
        let waiting = self.waiting.remove(&(author, number))?;
        self.waiting_bytes -= waiting.bytes;
        Some(waiting)
    }

    fn keep(&mut self, author: AuthorId, number: u64, offered: Waiting<T>) -> Offered<T> {
        match self.waiting.get(&(author, number)) {
            Some(waiting) if waiting.item == offered.item => return Offered::Waiting,
            Some(waiting) if waiting.stamp_us > offered.stamp_us => return Offered::Dropped,
            Some(waiting) if waiting.stamp_us == offered.stamp_us => return Offered::Conflict,
            _ => _ = self.take(author, number),
        }
        let ahead = number - self.vector.get(author);
        let room = self.config.max_waiting_bytes.saturating_sub(self.waiting_bytes);
        if ahead > self.config.max_ahead || offered.bytes > room {
            return Offered::Dropped;
        }
        self.waiting_bytes += offered.bytes;
        self.waiting.insert((author, number), offered);
        Offered::Waiting
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: AuthorId = AuthorId(1);

    #[test]
    fn what_a_run_before_has_put_in_vain_gives_way() {
        let mut sequence: ReorderBuffer<&str> =
            ReorderBuffer::starting_at(VersionVector::default(), SequenceConfig::default());
        // The first run's 1 was lost.
        assert_eq!(sequence.offer(ONE, 2, 12, 1, "old 2"), Offered::Waiting);
        assert_eq!(sequence.offer(ONE, 3, 13, 1, "old 3"), Offered::Waiting);
        assert_eq!(sequence.offer(ONE, 4, 14, 1, "old 4"), Offered::Waiting);
        assert_eq!(sequence.offer(ONE, 3, 23, 1, "new 3"), Offered::Waiting, "it takes the place");
        assert_eq!(sequence.offer(ONE, 3, 13, 1, "old 3"), Offered::Dropped);
        assert_eq!(sequence.offer(ONE, 3, 23, 1, "another 3"), Offered::Conflict);
        assert_eq!(sequence.offer(ONE, 1, 21, 1, "new 1"), Offered::Ready(vec!["new 1"]), "old 2 is none of its run");
        assert_eq!(sequence.offer(ONE, 2, 22, 1, "new 2"), Offered::Ready(vec!["new 2", "new 3"]));
        assert_eq!((sequence.vector().get(ONE), sequence.waiting(), sequence.waiting_bytes()), (3, 0, 0));
    }

    #[test]
    fn one_run_is_put_in_order() {
        let mut sequence: ReorderBuffer<u64> =
            ReorderBuffer::starting_at(VersionVector::default(), SequenceConfig::default());
        for number in [3, 2, 5, 4] {
            assert_eq!(sequence.offer(ONE, number, 10 + number, 1, number), Offered::Waiting);
        }
        assert_eq!(sequence.offer(ONE, 1, 11, 1, 1), Offered::Ready(vec![1, 2, 3, 4, 5]));
        assert_eq!(sequence.offer(ONE, 2, 12, 1, 2), Offered::Past);
    }
}
