//! One run of somebody who writes. The real journal numbers and stamps, the real window decides
//! what is sent and sent again, and what heads cover is read back and compared as the real
//! publisher does. The run of an explorer that was there before asks the server how far its series
//! got, waits until its copy of the map has come that far, finds its place, and continues from
//! there. What the run before had made and nobody acknowledged is gone with it, or waits on the
//! robot's disk: then it is delivered first.

use crate::simulation::follower::Follower;
use crate::simulation::message::{EVERYBODY, Message, SERVER, map};
use fht_proto::api::keys::Key;
use fht_proto::{AuthorId, Increment, Op, VersionVector, encode};
use mapper::publish::{Backlog, Journal, Verified, Window, WindowConfig};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long an answer may take.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);
/// How long a run waits for a server, and then for its copy, before it gives up.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long it takes to find its place in the map, microseconds, at most.
const FIND_US: u64 = 3_000_000;

/// Why a run has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// It was killed.
    Killed,
    /// It could not begin.
    NoAnswer,
    /// It learned that its numbers are taken.
    Told,
}

enum Stage {
    /// Waits for a server that has what the earlier runs had acknowledged, and reads back what the
    /// server has of their backlog: up to this number, once a server has answered.
    Reaches(Option<u64>),
    /// Publishes the backlog.
    Delivers,
    /// Waits for the server's head.
    Asks,
    /// Waits for its copy to come this far.
    Copies(VersionVector),
    /// Publishes; writes from this time on.
    Writes(u64),
}

pub(super) struct Writer {
    place: usize,
    id: AuthorId,
    /// Number of the last increment of earlier runs.
    first: u64,
    stage: Stage,
    begun: Instant,
    copy: Option<Follower>,
    journal: Journal,
    window: Window,
    /// What is on the robot's disk at least: acknowledgements are written there only with the next
    /// increment.
    durable: Backlog,
    written: Vec<Increment>,
    next_id: u64,
    asked: Option<(u64, Instant)>,
    verified: Verified,
    /// What it wants to read back, and the question under way.
    wanted: Option<VersionVector>,
    reading: Option<(u64, Instant)>,
    /// Whether increments under way count as lost if none of them is read back.
    doubts: bool,
}

impl Writer {
    /// The first run.
    pub(super) fn new(place: usize, now: Instant) -> Self {
        let id = AuthorId(place as u32);
        Self {
            place,
            id,
            first: 0,
            stage: Stage::Writes(0),
            begun: now,
            copy: None,
            journal: Journal::new(id),
            window: Window::new(WindowConfig::default()),
            durable: Backlog::default(),
            written: Vec::new(),
            next_id: 0,
            asked: None,
            verified: Verified::after(id, 0),
            wanted: None,
            reading: None,
            doubts: false,
        }
    }

    /// A later run; `index` counts them. `backlog` is what is on the robot's disk, if it keeps
    /// anything there.
    pub(super) fn again(place: usize, index: u64, backlog: Option<Backlog>, now: Instant) -> Self {
        /// How many questions a run, and its copy, may ask; their numbers tell answers to earlier
        /// runs apart.
        const QUESTIONS: u64 = 1 << 32;
        let next_id = 2 * index * QUESTIONS;
        let copy = Some(Follower::of_explorer(place, next_id + QUESTIONS));
        let first = Self::new(place, now);
        let Some(backlog) = backlog else { return Self { next_id, copy, stage: Stage::Asks, ..first } };
        let verified = Verified::after(first.id, backlog.acknowledged);
        let window = Window::of_backlog(WindowConfig::default(), backlog.clone());
        Self { next_id, copy, stage: Stage::Reaches(None), window, durable: backlog, verified, ..first }
    }

    /// What is on the robot's disk, if it keeps anything there: after an ill-timed kill a little
    /// more than necessary.
    pub(super) fn backlog(&self, rng: &mut ChaCha8Rng) -> Backlog {
        if rng.random_bool(0.5) { self.window.backlog() } else { self.durable.clone() }
    }

    /// Whether the earlier runs' backlog has been delivered.
    pub(super) fn has_delivered(&self) -> bool {
        !matches!(self.stage, Stage::Reaches(_) | Stage::Delivers)
    }

    pub(super) fn first(&self) -> u64 {
        self.first
    }

    pub(super) fn written(&self) -> &[Increment] {
        &self.written
    }

    pub(super) fn acknowledged(&self) -> u64 {
        self.window.acknowledged()
    }

    /// Whether everything that it has written is acknowledged.
    pub(super) fn is_idle(&self) -> bool {
        matches!(self.stage, Stage::Writes(_)) && self.window.is_empty()
    }

    pub(super) fn may_write(&self, now_us: u64) -> bool {
        matches!(self.stage, Stage::Writes(from_us) if now_us >= from_us)
    }

    pub(super) fn receive(&mut self, message: Message, now: Instant) -> Result<(), End> {
        let is_answer =
            matches!(message, Message::HeadAnswer { id, .. } if self.asked.is_some_and(|(asked, _)| asked == id));
        if let Some(copy) = self.copy.as_mut().filter(|_| !is_answer) {
            copy.receive(message.clone(), now);
        }
        let is_publishing = matches!(self.stage, Stage::Delivers | Stage::Writes(_));
        match (&self.stage, message) {
            (Stage::Reaches(_), Message::HeadAnswer { head, .. }) if is_answer => {
                self.asked = None;
                let vector = head.map(|head| head.vector.clone()).unwrap_or_default();
                if vector.get(self.id) >= self.window.acknowledged() {
                    (self.stage, self.begun) = (Stage::Reaches(Some(vector.get(self.id))), now);
                    self.see_head(&vector)?;
                }
            }
            (Stage::Asks, Message::HeadAnswer { head, .. }) if is_answer => {
                self.asked = None;
                let vector = head.map(|head| head.vector.clone()).unwrap_or_default();
                self.first = vector.get(self.id);
                // A server may lag behind the one that acknowledged the backlog.
                if self.first >= self.window.acknowledged() {
                    (self.stage, self.begun) = (Stage::Copies(vector), now);
                }
            }
            (_, Message::Head(head)) if is_publishing => {
                self.see_head(&head.vector)?;
            }
            (_, Message::HeadAnswer { head, .. }) if is_answer && is_publishing => {
                self.asked = None;
                self.doubts = true;
                self.see_head(&head.map(|head| head.vector.clone()).unwrap_or_default())?;
                if self.wanted.is_none() && self.reading.is_none() {
                    self.acknowledge(now)?;
                }
            }
            (_, Message::Piece { id, series }) if self.is_reading(id) => {
                self.verified.compare(&series, &self.window).map_err(|_| End::Told)?;
            }
            (_, Message::End { id }) if self.is_reading(id) => {
                self.reading = None;
                self.acknowledge(now)?;
            }
            (_, Message::Refused) if is_publishing => return Err(End::Told),
            _ => {}
        }
        Ok(())
    }

    fn is_reading(&self, id: u64) -> bool {
        self.reading.is_some_and(|(asked, _)| asked == id)
    }

    /// A head has reached `vector`.
    fn see_head(&mut self, vector: &VersionVector) -> Result<(), End> {
        self.window.check(vector.get(self.id)).map_err(|_| End::Told)?;
        self.wanted = self.verified.lacking(vector).or(self.wanted.take());
        Ok(())
    }

    fn acknowledge(&mut self, now: Instant) -> Result<(), End> {
        let is_news = self.window.acknowledge(self.verified.upto(), now).map_err(|_| End::Told)?;
        if std::mem::take(&mut self.doubts) && !is_news {
            self.window.lost();
        }
        Ok(())
    }

    /// Begins to publish once its copy has come as far as the server was.
    fn begin(&mut self, now: Instant, now_us: u64, rng: &mut ChaCha8Rng) -> Result<(), End> {
        let has_copy = |vector| self.copy.as_ref().is_some_and(|copy| copy.copy().vector().covers(vector));
        match &self.stage {
            Stage::Writes(_) => return Ok(()),
            Stage::Reaches(Some(stored)) if self.verified.upto() >= *stored => {
                (self.stage, self.begun) = (Stage::Delivers, now);
                return Ok(());
            }
            Stage::Delivers if self.window.is_empty() => {
                (self.stage, self.begun) = (Stage::Asks, now);
                return Ok(());
            }
            Stage::Copies(vector) if has_copy(vector) => {
                self.window = Window::after(WindowConfig::default(), self.first);
                self.durable = self.window.backlog();
                self.verified = Verified::after(self.id, self.first);
                self.stage = Stage::Writes(now_us + rng.random_range(0..=FIND_US));
                return Ok(());
            }
            Stage::Reaches(_) | Stage::Delivers | Stage::Asks | Stage::Copies(_) => {}
        }
        if now.duration_since(self.begun) >= PATIENCE { Err(End::NoAnswer) } else { Ok(()) }
    }

    /// What it sends now.
    pub(super) fn act(
        &mut self,
        now: Instant,
        now_us: u64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Vec<(usize, usize, Message)>, End> {
        self.begin(now, now_us, rng)?;
        let mut sent = self.copy.as_mut().map(|copy| copy.act(now, rng)).unwrap_or_default();
        while let Some((number, bytes)) = self.window.next().filter(|_| !matches!(self.stage, Stage::Reaches(_))) {
            let key = Key::increment(&map(), self.id, number).to_string();
            sent.push((self.place, EVERYBODY, Message::Put { key, bytes: Arc::new(bytes.to_vec()) }));
            self.window.put(now);
        }
        if self.asked.is_some_and(|(_, since)| now.duration_since(since) >= ANSWER_TIMEOUT) {
            self.asked = None;
            self.window.unanswered(now);
        }
        if self.reading.is_some_and(|(_, since)| now.duration_since(since) >= ANSWER_TIMEOUT) {
            self.reading = None;
            self.acknowledge(now)?;
        }
        if let Some(have) = self.wanted.take_if(|_| self.reading.is_none()) {
            self.next_id += 1;
            self.reading = Some((self.next_id, now));
            sent.push((self.place, SERVER, Message::AskSince { id: self.next_id, have }));
        }
        let is_due = match self.stage {
            Stage::Reaches(_) | Stage::Asks => self.reading.is_none(),
            Stage::Copies(_) => false,
            Stage::Delivers | Stage::Writes(_) => self.window.ask_at().is_some_and(|at| now >= at),
        };
        if self.asked.is_none() && is_due {
            self.next_id += 1;
            self.asked = Some((self.next_id, now));
            sent.push((self.place, SERVER, Message::AskHead { id: self.next_id }));
        }
        Ok(sent)
    }

    pub(super) fn write(&mut self, ops: Vec<Op>, now_us: u64) {
        if let Some(copy) = &self.copy {
            // The first increment of a run continues where the last run ended.
            match self.written.is_empty() {
                true => self.journal.resume(copy.copy().state(), self.window.acknowledged()),
                false => self.journal.follow(copy.copy().state(), self.window.acknowledged()),
            }
        }
        let Some(increment) = self.journal.write(ops, now_us) else { return };
        if let Ok(bytes) = encode(&increment) {
            self.window.push(increment.number, bytes);
            self.durable = self.window.backlog();
            self.written.push(increment);
        }
    }
}
