//! Those who write: explorers, and an operator who makes releases. What is sent and sent again is decided by the real window.

use super::{EVERYBODY, Message, SERVER, Violation, map};
use fht_proto::keys::Key;
use fht_proto::query::Head;
use fht_proto::{
    AuthorId, EdgeKey, FixedPose, Increment, NodeId, NodeKind, Op, Rect, Release, ReleaseId, ReleaseName, encode,
};
use mapper::window::{Window, WindowConfig};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long an answer may take.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);
/// Chance of writing in a step.
const WRITE_CHANCE: f64 = 0.03;
/// Nodes that are written about, so that authors meet.
const NODES: u32 = 12;

pub(super) struct Author {
    place: usize,
    id: AuthorId,
    /// How many increments it wants to write.
    last: u64,
    is_operator: bool,
    dies_us: Option<u64>,
    is_dead: bool,
    clock_us: u64,
    written: Vec<Increment>,
    window: Window,
    next_id: u64,
    asked: Option<(u64, Instant)>,
}

impl Author {
    pub(super) fn new(place: usize, last: u64, is_operator: bool, dies_us: Option<u64>) -> Self {
        Self {
            place,
            id: AuthorId(place as u32),
            last,
            is_operator,
            dies_us,
            is_dead: false,
            clock_us: 0,
            written: Vec::new(),
            window: Window::new(WindowConfig::default()),
            next_id: 0,
            asked: None,
        }
    }

    pub(super) fn place(&self) -> usize {
        self.place
    }

    pub(super) fn id(&self) -> AuthorId {
        self.id
    }

    pub(super) fn written(&self) -> &[Increment] {
        &self.written
    }

    pub(super) fn acknowledged(&self) -> u64 {
        self.window.acknowledged()
    }

    pub(super) fn is_done(&self) -> bool {
        self.is_dead || self.written.len() as u64 == self.last && self.window.is_empty()
    }

    pub(super) fn progress(&self) -> String {
        format!("{} of {} written, {} acknowledged", self.written.len(), self.last, self.window.acknowledged())
    }

    pub(super) fn receive(&mut self, message: Message, now: Instant) -> Result<(), Violation> {
        if self.is_dead {
            return Ok(());
        }
        let foreign = |error: mapper::window::ForeignWriter| Violation::Failed(error.to_string());
        match message {
            Message::Head(head) => _ = self.window.acknowledge(head.vector.get(self.id), now).map_err(foreign)?,
            Message::HeadAnswer { id, head } if self.asked.is_some_and(|(asked, _)| asked == id) => {
                self.asked = None;
                let stored = head.map_or(0, |head| head.vector.get(self.id));
                if !self.window.acknowledge(stored, now).map_err(foreign)? {
                    self.window.lost();
                }
            }
            _ => {}
        }
        Ok(())
    }

    pub(super) fn act(
        &mut self,
        now: Instant,
        now_us: u64,
        rng: &mut ChaCha8Rng,
        head: Option<&Head>,
    ) -> Vec<(usize, usize, Message)> {
        self.is_dead |= self.dies_us.is_some_and(|dies_us| now_us >= dies_us);
        if self.is_dead {
            return Vec::new();
        }
        let chance = if self.is_operator { WRITE_CHANCE / 5.0 } else { WRITE_CHANCE };
        if (self.written.len() as u64) < self.last && rng.random_bool(chance) {
            self.write(now_us, rng, head);
        }
        let mut sent = Vec::new();
        while let Some((number, bytes)) = self.window.next() {
            let key = Key::increment(&map(), self.id, number).to_string();
            sent.push((self.place, EVERYBODY, Message::Put { key, bytes: Arc::new(bytes.to_vec()) }));
            self.window.put(now);
        }
        if self.asked.is_some_and(|(_, since)| now.duration_since(since) >= ANSWER_TIMEOUT) {
            self.asked = None;
            self.window.unanswered(now);
        }
        if self.asked.is_none() && self.window.ask_at().is_some_and(|at| now >= at) {
            self.next_id += 1;
            self.asked = Some((self.next_id, now));
            sent.push((self.place, SERVER, Message::AskHead { id: self.next_id }));
        }
        sent
    }

    fn write(&mut self, now_us: u64, rng: &mut ChaCha8Rng, head: Option<&Head>) {
        let mut ops: Vec<Op> = (0..rng.random_range(1..4)).map(|_| op(rng)).collect();
        if self.is_operator
            && let Some(head) = head
        {
            // As an operator's program does: of what the server says that it has.
            let name = format!("r.{}", self.written.len() / 2);
            let release = Release { vector: head.vector.clone(), digest: head.digest };
            let name: Option<ReleaseName> = name.parse().ok();
            // Now and then it tells robots to use the one that it made last, or the newest state.
            if rng.random_bool(0.3) {
                let made = format!("r.{}", (self.written.len() / 2).saturating_sub(1)).parse().ok();
                let made = made.filter(|_| rng.random_bool(0.8)).map(|name| ReleaseId { author: self.id, name });
                ops.push(Op::Enable { release: made });
            }
            ops.extend(name.map(|name| Op::PutRelease { name, release }));
        }
        self.clock_us = now_us.max(self.clock_us + 1);
        let number = self.written.len() as u64 + 1;
        let increment = Increment { author: self.id, number, hlc_us: self.clock_us, ops };
        if let Ok(bytes) = encode(&increment) {
            self.window.push(number, bytes);
            self.written.push(increment);
        }
    }
}

fn op(rng: &mut ChaCha8Rng) -> Op {
    let mut node = || NodeId { author: AuthorId(rng.random_range(1..3)), number: rng.random_range(0..NODES) };
    let (id, other) = (node(), node());
    let pose = FixedPose::from_metres(rng.random_range(-20.0..20.0), rng.random_range(-20.0..20.0), 0.0);
    match rng.random_range(0..8) {
        0 | 1 => Op::PutNode { id, kind: NodeKind::Support, pose },
        2 => Op::SetPose { id, pose },
        3 => Op::SetFreeSpace { id, rect: Some(Rect { east_mm: rng.random_range(0..2000), ..Rect::default() }) },
        4 => Op::RemoveNode { id },
        5 if id != other => Op::RemoveEdge { edge: EdgeKey::new(id, other) },
        _ if id != other => Op::PutEdge { edge: EdgeKey::new(id, other) },
        _ => Op::SetTrust { id, percent: rng.random_range(0..=100) },
    }
}
