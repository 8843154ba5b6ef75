//! What a stateless server needs of the storages in the site's routers: they are dumb, so that it puts and asks, and counts who holds
//! what. The questions wait for answers; none is put by a thread of the network's.

pub mod over_zenoh;

use fht_proto::{AuthorId, Increment, MapName, decode};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;

/// How many storages there are, and how many of them must hold what is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuorumConfig {
    /// Storages of the site, each in a router of its own.
    pub storages: usize,
    /// So many must hold an increment before a head covers it. More than half of them, so that any two such sets share one.
    pub confirm: usize,
}

impl QuorumConfig {
    /// More than half of `storages`.
    #[must_use]
    pub fn majority(storages: usize) -> Self {
        Self { storages, confirm: storages / 2 + 1 }
    }

    /// So many must answer a server that wants to know all that was acknowledged.
    #[must_use]
    pub fn to_read(self) -> usize {
        (self.storages + 1).saturating_sub(self.confirm)
    }
}

/// The place of an increment.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The map.
    pub map: MapName,
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
}

/// What storages hold at one place: their payloads, each with how many storages hold it. One payload, unless writers or servers
/// disagreed.
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

    /// The payloads, least first.
    pub fn payloads(&self) -> impl Iterator<Item = &[u8]> {
        self.0.keys().map(Vec::as_slice)
    }

    /// What most of them hold, and how many do; of equals that of the latest stamp, and then the least. A writer that failed and came back has
    /// stamped later: what it put in vain before does not stand against what it has put since.
    #[must_use]
    pub fn most(self) -> Option<(Vec<u8>, usize)> {
        let rank = |bytes: &[u8], copies: usize| (copies, stamp_of(bytes));
        self.0.into_iter().reduce(|best, next| if rank(&next.0, next.1) > rank(&best.0, best.1) { next } else { best })
    }
}

/// The stamp of an increment; none of what is none.
fn stamp_of(bytes: &[u8]) -> Option<u64> {
    decode::<Increment>(bytes).ok().map(|increment| increment.hlc_us)
}

/// Whether everybody takes `one` rather than `other`, of two increments of one author and number: the later, or the one of lesser bytes.
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
    /// Has all storages hold `bytes` at a place. Some of them may not hear of it.
    fn put(&self, place: &Place, bytes: &[u8]);

    /// What is held at each of `places`. Waits for no more than `enough` answers for each.
    fn held(&self, places: &[Place], enough: usize) -> Vec<Held>;

    /// How many storages are there.
    fn present(&self) -> usize;

    /// Whose increments are held. None if a storage that is there did not come to the end of its answer in time: to those that it holds
    /// nobody may say that there is no such map.
    fn authors(&self) -> Option<BTreeSet<(MapName, AuthorId)>>;

    /// Everything that is held of an author, by number; none as for [`authors`](Self::authors).
    fn all_of(&self, map: &MapName, author: AuthorId) -> Option<BTreeMap<u64, Held>>;

    /// Waits before a question is put again that was put `attempts` times. False if it need not be put again: the server ends.
    fn pause(&self, attempts: u32) -> bool;
}
