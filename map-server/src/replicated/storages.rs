//! What a stateless server needs of the storages in the site's routers. Storages only keep and
//! answer: the server puts and asks, and counts which of them hold what. Questions block, so no
//! thread of the network may ask them.

use fht_proto::{AuthorId, Increment, MapName, decode};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

/// The place of an increment.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct IncrementKey {
    /// The map.
    pub map: MapName,
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
}

/// What storages hold at one place: payloads, each with the number of storages that hold it. There
/// is one payload, unless writers or servers disagreed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Held(BTreeMap<Vec<u8>, usize>);

impl Held {
    /// One more storage holds `bytes`.
    pub fn add(&mut self, bytes: Vec<u8>) {
        *self.0.entry(bytes).or_default() += 1;
    }

    /// How many storages hold `bytes`.
    #[must_use]
    pub fn copies(&self, bytes: &[u8]) -> usize {
        self.0.get(bytes).copied().unwrap_or(0)
    }

    /// How many storages have answered.
    #[must_use]
    pub fn answers(&self) -> usize {
        self.0.values().sum()
    }

    /// The payloads, in ascending order.
    pub fn payloads(&self) -> impl Iterator<Item = &[u8]> {
        self.0.keys().map(Vec::as_slice)
    }

    /// The payload that most storages hold, and how many do; among equals the one with the latest
    /// stamp, then the least. A writer that failed and came back stamps later: what it put in vain
    /// before does not stand against what it has put since.
    #[must_use]
    pub fn most_held(self) -> Option<(Vec<u8>, usize)> {
        let rank = |bytes: &[u8], copies: usize| (copies, stamp_of(bytes));
        self.0.into_iter().reduce(|best, next| if rank(&next.0, next.1) > rank(&best.0, best.1) { next } else { best })
    }
}

/// The stamp of an increment; none if `bytes` are not one.
fn stamp_of(bytes: &[u8]) -> Option<u64> {
    decode::<Increment>(bytes).ok().map(|increment| increment.hlc_us)
}

/// Whether all servers take `one` rather than `other`, of two increments of one author and number:
/// the later, or the one whose bytes compare less.
#[must_use]
pub fn stands_before(one: &[u8], other: &[u8]) -> bool {
    match stamp_of(one).cmp(&stamp_of(other)) {
        Ordering::Greater => true,
        Ordering::Equal => one < other,
        Ordering::Less => false,
    }
}

/// The storages.
pub trait Storages: Send + Sync + Debug {
    /// Has all storages hold `bytes` at a place. Some of them may not receive it.
    fn put(&self, place: &IncrementKey, bytes: &[u8]);

    /// What is held at each of `places`. Waits for at most `enough` answers for each.
    fn held(&self, places: &[IncrementKey], enough: usize) -> Vec<Held>;

    /// How many storages are present.
    fn present(&self) -> usize;

    /// The authors whose increments are held. None if a storage that is present did not answer
    /// completely in time: a client must not be told that a map does not exist which that storage
    /// may hold.
    fn authors(&self) -> Option<BTreeSet<(MapName, AuthorId)>>;

    /// Everything that is held of an author, by number; none as for [`authors`](Self::authors).
    fn all_of(&self, map: &MapName, author: AuthorId) -> Option<BTreeMap<u64, Held>>;

    /// Waits before a question is repeated that was asked `attempts` times. False if it need not be
    /// repeated, because the server ends.
    fn pause(&self, attempts: u32) -> bool;
}
