//! A client: the real copy, and the real decisions about what to ask. Questions that are not
//! answered in time end.

use crate::simulation::message::{Message, SERVER};
use fht_client::{Sync, SyncConfig, SyncQuestion};
use fht_map::Replica;
use fht_proto::{Digest, Increment, decode};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::time::{Duration, Instant};

/// How long an answer may take.
const HEAD_TIMEOUT: Duration = Duration::from_secs(1);
const PART_TIMEOUT: Duration = Duration::from_secs(5);
/// Chance that the robot is restarted in a step.
const RESTART_CHANCE: f64 = 0.0005;

pub(super) struct Follower {
    place: usize,
    copy: Replica,
    sync: Sync,
    next_id: u64,
    /// The questions under way, and since when.
    head: Option<(u64, Instant)>,
    part: Option<(u64, Instant)>,
    is_calm: bool,
}

impl Follower {
    pub(super) fn new(place: usize) -> Self {
        let (copy, sync) = (Replica::default(), Sync::new(SyncConfig::default()));
        Self { place, copy, sync, next_id: 0, head: None, part: None, is_calm: false }
    }

    /// The copy that an explorer keeps: it is never restarted alone. Its questions are numbered
    /// after `next_id`.
    pub(super) fn of_explorer(place: usize, next_id: u64) -> Self {
        Self { next_id, is_calm: true, ..Self::new(place) }
    }

    pub(super) fn place(&self) -> usize {
        self.place
    }

    pub(super) fn copy(&self) -> &Replica {
        &self.copy
    }

    /// What it runs: the digest of the enabled release; none: its copy.
    pub(super) fn runs(&self) -> Option<Digest> {
        self.sync.running().map(|running| running.state.digest())
    }

    pub(super) fn calm(&mut self) {
        self.is_calm = true;
    }

    pub(super) fn receive(&mut self, message: Message, now: Instant) {
        match message {
            Message::Put { bytes, .. } => {
                if let Ok(increment) = decode::<Increment>(&bytes) {
                    self.sync.live(&mut self.copy, increment);
                }
            }
            Message::Head(head) => self.sync.head_published(&head),
            Message::HeadAnswer { id, head } if self.head.is_some_and(|(asked, _)| asked == id) => {
                self.head = None;
                self.sync.head_answered(&self.copy, head.map(|head| head.as_ref().clone()), now);
            }
            Message::Piece { id, series } if self.part.is_some_and(|(asked, _)| asked == id) => {
                self.sync.piece(&mut self.copy, series.as_ref().clone());
            }
            Message::End { id } if self.part.is_some_and(|(asked, _)| asked == id) => {
                self.part = None;
                self.sync.part_ended(&mut self.copy, now);
            }
            _ => {}
        }
    }

    pub(super) fn act(&mut self, now: Instant, rng: &mut ChaCha8Rng) -> Vec<(usize, usize, Message)> {
        if !self.is_calm && rng.random_bool(RESTART_CHANCE) {
            let next_id = self.next_id;
            *self = Self { next_id, ..Self::new(self.place) };
        }
        if self.head.is_some_and(|(_, since)| now.duration_since(since) >= HEAD_TIMEOUT) {
            self.head = None;
            self.sync.head_answered(&self.copy, None, now);
        }
        if self.part.is_some_and(|(_, since)| now.duration_since(since) >= PART_TIMEOUT) {
            self.part = None;
            self.sync.part_ended(&mut self.copy, now);
        }
        let mut sent = Vec::new();
        while let Some(question) = self.sync.poll(&self.copy, now) {
            self.next_id += 1;
            let id = self.next_id;
            let message = match question {
                SyncQuestion::Head => {
                    self.head = Some((id, now));
                    Message::AskHead { id }
                }
                SyncQuestion::Since(have) => {
                    self.part = Some((id, now));
                    Message::AskSince { id, have }
                }
                SyncQuestion::At { vector, have } => {
                    self.part = Some((id, now));
                    Message::AskAt { id, vector, have }
                }
            };
            sent.push((self.place, SERVER, message));
        }
        sent
    }
}
