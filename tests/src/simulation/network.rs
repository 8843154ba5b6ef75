//! Links that lose, delay, repeat and reorder; places that are cut off from everybody; and
//! partitions: two groups between which nothing passes for a while.

use crate::simulation::message::Message;
use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// How bad the network is.
#[derive(Clone, Debug)]
pub struct NetworkConfig {
    /// Share of messages lost. Default 0.1.
    pub loss: f64,
    /// Share of messages that come twice. Default 0.05.
    pub repeated: f64,
    /// Least and greatest delay, milliseconds; messages overtake each other. Default 1 to 400.
    pub delay_ms: (u64, u64),
    /// Average time between cuts of one place, seconds. Default 20.
    pub cut_every_s: f64,
    /// Longest cut, seconds. Default 15.
    pub cut_for_s: u64,
    /// Average time between partitions into two groups, seconds. Default 20.
    pub part_every_s: f64,
    /// Longest partition, seconds. Default 10.
    pub part_for_s: u64,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        Self {
            loss: 0.1,
            repeated: 0.05,
            delay_ms: (1, 400),
            cut_every_s: 20.0,
            cut_for_s: 15,
            part_every_s: 20.0,
            part_for_s: 10,
        }
    }
}

/// All links.
pub(super) struct Network {
    config: NetworkConfig,
    is_calm: bool,
    /// Places that receive what is published; the others are storages, which only servers talk to.
    hearers: usize,
    /// By time of arrival and order of sending.
    under_way: BTreeMap<(u64, u64), (usize, usize, Message)>,
    /// Until when each place is cut off from everybody.
    cut_until_us: Vec<u64>,
    /// Until when nothing passes between the two groups.
    parted_until_us: u64,
    /// Who is in the second group.
    is_beyond: Vec<bool>,
    counts: NetworkCounts,
}

/// What has happened.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct NetworkCounts {
    pub(super) sent: u64,
    pub(super) lost: u64,
    pub(super) partitions: u64,
}

/// Least and greatest delay of a link in calm times, milliseconds.
const CALM_DELAY_MS: (u64, u64) = (1, 20);
/// Steps in a second.
const STEPS_PER_S: f64 = 100.0;

impl Network {
    /// `hearers` are the first of all `places`.
    pub(super) fn new(config: NetworkConfig, hearers: usize, places: usize) -> Self {
        Self {
            config,
            is_calm: false,
            hearers,
            under_way: BTreeMap::new(),
            cut_until_us: vec![0; places],
            parted_until_us: 0,
            is_beyond: vec![false; places],
            counts: NetworkCounts::default(),
        }
    }

    /// From now on everything arrives.
    pub(super) fn calm(&mut self) {
        self.is_calm = true;
        self.cut_until_us.fill(0);
        self.parted_until_us = 0;
    }

    pub(super) fn counts(&self) -> NetworkCounts {
        self.counts
    }

    fn is_cut(&self, place: usize, now_us: u64) -> bool {
        self.cut_until_us.get(place).is_some_and(|until_us| *until_us > now_us)
    }

    /// Whether a message can pass from one place to another: neither is cut off, and they are in
    /// one group.
    pub(super) fn reaches(&self, from: usize, to: usize, now_us: u64) -> bool {
        let is_parted = self.parted_until_us > now_us && self.is_beyond.get(from) != self.is_beyond.get(to);
        !is_parted && !self.is_cut(from, now_us) && !self.is_cut(to, now_us)
    }

    /// Messages between two places overtake each other; but the end of an answer comes last, as
    /// Zenoh guarantees.
    pub(super) fn send(&mut self, from: usize, to: usize, message: Message, now_us: u64, rng: &mut ChaCha8Rng) {
        self.counts.sent += 1;
        let trouble = !self.is_calm;
        if trouble && (!self.reaches(from, to, now_us) || rng.random_bool(self.config.loss)) {
            self.counts.lost += 1;
            return;
        }
        let copies = 1 + usize::from(trouble && rng.random_bool(self.config.repeated));
        let (least, greatest) = if trouble { self.config.delay_ms } else { CALM_DELAY_MS };
        for _ in 0..copies {
            let delay_ms =
                if matches!(message, Message::End { .. }) { greatest } else { rng.random_range(least..=greatest) };
            let at_us = now_us + 1000 * delay_ms;
            let order = self.counts.sent * 2 + self.under_way.len() as u64;
            let mut key = (at_us, order);
            while self.under_way.contains_key(&key) {
                key.1 += 1;
            }
            self.under_way.insert(key, (from, to, message.clone()));
        }
    }

    /// Sends to everybody else, each on its own link.
    pub(super) fn publish(&mut self, from: usize, message: &Message, now_us: u64, rng: &mut ChaCha8Rng) {
        for to in (0..self.hearers).filter(|&to| to != from) {
            self.send(from, to, message.clone(), now_us, rng);
        }
    }

    /// What arrives now; messages whose way is now interrupted are lost.
    pub(super) fn arriving(&mut self, now_us: u64) -> Vec<(usize, usize, Message)> {
        let later = self.under_way.split_off(&(now_us + 1, 0));
        let due = std::mem::replace(&mut self.under_way, later);
        let (arrived, lost): (Vec<_>, Vec<_>) =
            due.into_values().partition(|(from, to, _)| self.reaches(*from, *to, now_us));
        self.counts.lost += lost.len() as u64;
        arrived
    }

    /// By chance, cuts a place off, or splits all places into two groups.
    pub(super) fn weather(&mut self, now_us: u64, rng: &mut ChaCha8Rng) {
        if self.is_calm {
            return;
        }
        let chance = 1.0 / (self.config.cut_every_s * STEPS_PER_S);
        for until_us in &mut self.cut_until_us {
            if *until_us <= now_us && rng.random_bool(chance) {
                *until_us = now_us + 1_000_000 * rng.random_range(1..=self.config.cut_for_s);
            }
        }
        if self.parted_until_us <= now_us && rng.random_bool(1.0 / (self.config.part_every_s * STEPS_PER_S)) {
            self.part(now_us, rng);
        }
    }

    /// At least two in each group: one alone is cut off.
    fn part(&mut self, now_us: u64, rng: &mut ChaCha8Rng) {
        let places = self.is_beyond.len();
        if places < 4 {
            return;
        }
        let beyond = rng.random_range(2..=places - 2);
        self.is_beyond.iter_mut().enumerate().for_each(|(index, is_beyond)| *is_beyond = index < beyond);
        self.is_beyond.shuffle(rng);
        self.parted_until_us = now_us + 1_000_000 * rng.random_range(1..=self.config.part_for_s);
        self.counts.partitions += 1;
    }
}
