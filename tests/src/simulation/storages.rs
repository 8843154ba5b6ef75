//! Replicated storages under several servers. They are plain: the newest put wins. Each runs on a
//! machine of its own that fails at some writes, before or after them, and keeps what it has. Puts
//! and questions may be lost on the way to any of them, and puts may arrive late. Storages that are
//! up and reach each other align now and then. Each has a place in the network, so it may be cut
//! off, or partitioned from servers and from other storages.

use crate::simulation::message::{Message, map};
use crate::simulation::network::NetworkConfig;
use fht_proto::api::keys::Key;
use fht_proto::{AuthorId, Increment, MapName, encode};
use map_server::QuorumConfig;
use map_server::replicated::{Held, IncrementKey, Storages};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How many storages a site has.
pub(super) const COUNT: usize = 3;
/// How long a storage's machine takes to come back, seconds, at most.
const DOWN_S: u64 = 5;
/// Chance that two storages align in a step.
const ALIGN_CHANCE: f64 = 0.005;
/// Share of puts that arrive late, and by how much, microseconds, at most.
const LATE: (f64, u64) = (0.1, 2_000_000);
/// A server gives up after so many questions and is started anew.
const PATIENCE: u32 = 8;

/// When and by whom something was put; the newest counts.
type Stamp = (u64, u64);

#[derive(Debug, Default)]
struct Storage {
    held: BTreeMap<IncrementKey, (Stamp, Vec<u8>)>,
    down_until_us: u64,
}

impl Storage {
    fn take_put(&mut self, place: &IncrementKey, stamp: Stamp, bytes: &[u8]) {
        if self.held.get(place).is_none_or(|(before, _)| *before < stamp) {
            self.held.insert(place.clone(), (stamp, bytes.to_vec()));
        }
    }
}

/// A put that arrives late.
#[derive(Debug)]
struct Late {
    at_us: u64,
    server: usize,
    storage: usize,
    place: IncrementKey,
    stamp: Stamp,
    bytes: Vec<u8>,
}

/// Which places reach each other now.
#[derive(Debug)]
pub(super) struct Reach {
    /// By server.
    pub(super) servers: Vec<[bool; COUNT]>,
    /// By storage.
    pub(super) storages: [[bool; COUNT]; COUNT],
}

#[derive(Debug)]
struct State {
    rng: ChaCha8Rng,
    loss: f64,
    crash_share: f64,
    now_us: u64,
    puts: u64,
    crashes: u64,
    storages: [Storage; COUNT],
    late: Vec<Late>,
    reach: Reach,
    /// What each server has put since the last call: the others receive it, too.
    heard: Vec<Vec<Message>>,
}

impl State {
    fn is_up(&self, storage: usize) -> bool {
        self.storages[storage].down_until_us <= self.now_us
    }

    /// Whether a message between a server and a storage arrives.
    fn arrives(&mut self, server: usize, storage: usize) -> bool {
        self.reach.servers[server][storage] && self.is_up(storage) && !self.rng.random_bool(self.loss)
    }

    /// The storages that a server is connected to, if all of them answer completely.
    fn answering(&mut self, server: usize) -> Option<Vec<usize>> {
        let is_there = |storage: &usize| self.reach.servers[server][*storage] && self.is_up(*storage);
        let there: Vec<usize> = (0..COUNT).filter(is_there).collect();
        there.iter().all(|&storage| self.arrives(server, storage)).then_some(there)
    }

    /// Writes, unless the machine fails before it; it may also fail after it.
    fn write(&mut self, storage: usize, place: &IncrementKey, stamp: Stamp, bytes: &[u8]) {
        let half = self.crash_share / 2.0;
        let (before, after) = (self.rng.random_bool(half), self.rng.random_bool(half));
        if !before {
            self.storages[storage].take_put(place, stamp, bytes);
        }
        if before || after {
            self.crashes += 1;
            self.storages[storage].down_until_us = self.now_us + 1_000_000 * self.rng.random_range(0..=DOWN_S);
        }
    }
}

/// The storages of a site.
#[derive(Clone, Debug)]
pub(super) struct Site(Arc<Mutex<State>>);

impl Site {
    pub(super) fn new(network: &NetworkConfig, crash_share: f64, servers: usize, seed: u64) -> Self {
        let state = State {
            rng: ChaCha8Rng::seed_from_u64(seed),
            loss: network.loss,
            crash_share,
            now_us: 0,
            puts: 0,
            crashes: 0,
            storages: Default::default(),
            late: Vec::new(),
            reach: Reach { servers: vec![[true; COUNT]; servers], storages: [[true; COUNT]; COUNT] },
            heard: vec![Vec::new(); servers],
        };
        Self(Arc::new(Mutex::new(state)))
    }

    pub(super) fn servers(&self) -> usize {
        self.lock().heard.len()
    }

    pub(super) fn quorum() -> QuorumConfig {
        QuorumConfig::majority(COUNT)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// From now on nothing fails.
    pub(super) fn calm(&self) {
        let mut state = self.lock();
        (state.loss, state.crash_share) = (0.0, 0.0);
        state.storages.iter_mut().for_each(|storage| storage.down_until_us = 0);
    }

    pub(super) fn crashes(&self) -> u64 {
        self.lock().crashes
    }

    /// Advances the time.
    pub(super) fn step(&self, now_us: u64, reach: Reach) {
        let mut state = self.lock();
        (state.now_us, state.reach) = (now_us, reach);
        let due: Vec<_> = state.late.extract_if(.., |late| late.at_us <= now_us).collect();
        for Late { server, storage, place, stamp, bytes, .. } in due {
            if state.is_up(storage) && state.reach.servers[server][storage] {
                state.write(storage, &place, stamp, &bytes);
            }
        }
        if state.rng.random_bool(ALIGN_CHANCE) {
            let one = state.rng.random_range(0..COUNT);
            let other = (one + state.rng.random_range(1..COUNT)) % COUNT;
            if state.is_up(one) && state.is_up(other) && state.reach.storages[one][other] {
                for (from, to) in [(one, other), (other, one)] {
                    for (place, (stamp, bytes)) in state.storages[from].held.clone() {
                        state.storages[to].take_put(&place, stamp, &bytes);
                    }
                }
            }
        }
    }

    /// Whether a server can expect what it puts to be confirmed.
    pub(super) fn is_within_reach(&self, server: usize) -> bool {
        let state = self.lock();
        let is_there = |storage: &usize| state.is_up(*storage) && state.reach.servers[server][*storage];
        (0..COUNT).filter(is_there).count() >= Self::quorum().confirm
    }

    /// How many storages hold an increment.
    pub(super) fn copies(&self, increment: &Increment) -> usize {
        let place = IncrementKey { map: map(), author: increment.author, number: increment.number };
        let Ok(bytes) = encode(increment) else { return 0 };
        let holds = |storage: &&Storage| storage.held.get(&place).is_some_and(|(_, held)| *held == bytes);
        self.lock().storages.iter().filter(holds).count()
    }

    /// What a server has put since the last call.
    pub(super) fn take_puts(&self, server: usize) -> Vec<Message> {
        std::mem::take(&mut self.lock().heard[server])
    }

    /// The storages as one of the servers sees them.
    pub(super) fn seen_by(&self, server: usize) -> Arc<dyn Storages> {
        Arc::new(Seen { site: self.clone(), server })
    }
}

#[derive(Debug)]
struct Seen {
    site: Site,
    server: usize,
}

impl Storages for Seen {
    fn put(&self, place: &IncrementKey, bytes: &[u8]) {
        let mut state = self.site.lock();
        state.puts += 1;
        let stamp = (state.now_us, state.puts);
        for storage in 0..COUNT {
            if !state.arrives(self.server, storage) {
                continue;
            }
            if state.loss > 0.0 && state.rng.random_bool(LATE.0) {
                let at_us = state.now_us + state.rng.random_range(1..LATE.1);
                let (server, place, bytes) = (self.server, place.clone(), bytes.to_vec());
                state.late.push(Late { at_us, server, storage, place, stamp, bytes });
            } else {
                state.write(storage, place, stamp, bytes);
            }
        }
        let key = Key::kept(&place.map, place.author, place.number).to_string();
        state.heard[self.server].push(Message::Put { key, bytes: Arc::new(bytes.to_vec()) });
    }

    fn held(&self, places: &[IncrementKey], enough: usize) -> Vec<Held> {
        let mut state = self.site.lock();
        let of_place = |place: &IncrementKey| {
            let mut held = Held::default();
            for storage in 0..COUNT {
                if held.answers() < enough && state.arrives(self.server, storage) {
                    state.storages[storage].held.get(place).into_iter().for_each(|(_, bytes)| held.add(bytes.clone()));
                }
            }
            held
        };
        places.iter().map(of_place).collect()
    }

    fn present(&self) -> usize {
        let mut state = self.site.lock();
        (0..COUNT).filter(|&storage| state.arrives(self.server, storage)).count()
    }

    fn authors(&self) -> Option<BTreeSet<(MapName, AuthorId)>> {
        let mut state = self.site.lock();
        let mut authors = BTreeSet::new();
        for storage in state.answering(self.server)? {
            let places = state.storages[storage].held.keys().filter(|place| place.number == 1);
            authors.extend(places.map(|place| (place.map.clone(), place.author)));
        }
        Some(authors)
    }

    fn all_of(&self, map: &MapName, author: AuthorId) -> Option<BTreeMap<u64, Held>> {
        let mut state = self.site.lock();
        let mut all: BTreeMap<u64, Held> = BTreeMap::new();
        for storage in state.answering(self.server)? {
            let of_author = |place: &&IncrementKey| (&place.map, place.author) == (map, author);
            for place in state.storages[storage].held.keys().filter(of_author) {
                let (_, bytes) = &state.storages[storage].held[place];
                all.entry(place.number).or_default().add(bytes.clone());
            }
        }
        Some(all)
    }

    fn pause(&self, attempts: u32) -> bool {
        attempts < PATIENCE
    }
}
