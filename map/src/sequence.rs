//! Puts each author's numbered increments in order: passes on what continues the author's sequence without a gap and keeps
//! what is early, within bounds. What is dropped for lack of room is not lost: a writer sends again whatever its server's
//! head does not cover, and a replica asks for it.

use fht_proto::{AuthorId, VersionVector};
use std::collections::BTreeMap;

/// How much may wait for a gap to close.
#[derive(Clone, Debug)]
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
    /// A different item of this author and number is already waiting; the offered one was dropped.
    Conflict,
    /// Too far ahead or no room; it was dropped.
    Dropped,
}

/// The sequences of all authors of one map.
#[derive(Clone, Debug)]
pub struct Sequence<T> {
    config: SequenceConfig,
    vector: VersionVector,
    waiting: BTreeMap<(AuthorId, u64), (usize, T)>,
    waiting_bytes: usize,
}

impl<T: PartialEq> Sequence<T> {
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

    /// Bytes that wait, as they were offered.
    #[must_use]
    pub fn waiting_bytes(&self) -> usize {
        self.waiting_bytes
    }

    /// Offers item `number` (from 1) of `author`, which takes up `bytes`.
    pub fn offer(&mut self, author: AuthorId, number: u64, bytes: usize, item: T) -> Offered<T> {
        let passed = self.vector.get(author);
        if number <= passed {
            return Offered::Past;
        }
        if number > passed + 1 {
            return self.keep(author, number, bytes, item);
        }
        let mut ready = vec![item];
        // The one that waited under this number, if any, gives way.
        self.take(author, number);
        ready.extend(self.follow(author, number));
        Offered::Ready(ready)
    }

    /// Everything of `author` up to `last` has come another way. Returns what is next, in order, of what waited.
    pub fn skip(&mut self, author: AuthorId, last: u64) -> Vec<T> {
        if last <= self.vector.get(author) {
            return Vec::new();
        }
        while let Some(&(_, number)) = self.waiting.range((author, 0)..=(author, last)).next().map(|(key, _)| key) {
            self.take(author, number);
        }
        self.follow(author, last)
    }

    /// What waited behind `last`, which was passed on.
    fn follow(&mut self, author: AuthorId, mut last: u64) -> Vec<T> {
        let mut ready = Vec::new();
        while let Some(next) = last.checked_add(1).and_then(|next| self.take(author, next)) {
            ready.push(next);
            last += 1;
        }
        self.vector.set(author, last);
        ready
    }

    fn take(&mut self, author: AuthorId, number: u64) -> Option<T> {
        let (bytes, item) = self.waiting.remove(&(author, number))?;
        self.waiting_bytes -= bytes;
        Some(item)
    }

    fn keep(&mut self, author: AuthorId, number: u64, bytes: usize, item: T) -> Offered<T> {
        if let Some((_, waiting)) = self.waiting.get(&(author, number)) {
            return if *waiting == item { Offered::Waiting } else { Offered::Conflict };
        }
        let ahead = number - self.vector.get(author);
        let room = self.config.max_waiting_bytes.saturating_sub(self.waiting_bytes);
        if ahead > self.config.max_ahead || bytes > room {
            return Offered::Dropped;
        }
        self.waiting_bytes += bytes;
        self.waiting.insert((author, number), (bytes, item));
        Offered::Waiting
    }
}
