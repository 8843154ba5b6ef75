//! Those who write: explorers, and an operator who makes releases. Explorers are killed; most of
//! them come back under their own name and continue their own numbers. Some keep unacknowledged
//! increments on a disk and deliver those first. A run that learns that somebody else has used its
//! numbers ends, and the next one begins; a robot that keeps its increments never learns that.

use crate::simulation::message::Message;
use crate::simulation::outcome::Violation;
use crate::simulation::writer::{End, Writer};
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, NodeId, NodeKind, Op, Rect, Release, ReleaseId, ReleaseName};
use mapper::publish::Backlog;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::time::Instant;

/// Chance of writing in a step.
const WRITE_CHANCE: f64 = 0.03;
/// How many nodes are written about; few, so that authors meet.
const NODES: u32 = 12;
/// How long a killed explorer is away, microseconds, least and most.
const AWAY_US: (u64, u64) = (100_000, 8_000_000);
/// Share of returned explorers that are killed again.
const DYING_AGAIN: f64 = 0.5;
/// How soon, microseconds, at most.
const AGAIN_US: u64 = 15_000_000;

/// A run, as far as it got.
pub(super) struct Run {
    pub(super) written: Vec<Increment>,
    pub(super) acknowledged: u64,
    /// Whether it ended because its numbers are another's.
    pub(super) is_told: bool,
}

impl Run {
    /// Number of its newest increment.
    fn last(&self) -> u64 {
        self.written.last().map_or(0, |increment| increment.number).max(self.acknowledged)
    }

    fn of(writer: &Writer, is_told: bool) -> Self {
        let acknowledged = writer.acknowledged().max(writer.first());
        Self { written: writer.written().to_vec(), acknowledged, is_told }
    }
}

pub(super) struct Author {
    place: usize,
    id: AuthorId,
    /// How many increments it wants to write.
    last: u64,
    is_operator: bool,
    /// Chance of coming back.
    returning: f64,
    /// Whether unacknowledged increments survive a run.
    keeps: bool,
    backlog: Option<Backlog>,
    /// From then on nobody is killed.
    calm_us: u64,
    dies_us: Option<u64>,
    back_us: Option<u64>,
    writer: Option<Writer>,
    /// Why the run is about to end.
    ends: Option<End>,
    past: Vec<Run>,
    past_written: u64,
    returns: u64,
}

impl Author {
    pub(super) fn new(
        place: usize,
        last: u64,
        is_operator: bool,
        (dies_us, calm_us): (Option<u64>, u64),
        returning: f64,
        keeps: bool,
        now: Instant,
    ) -> Self {
        Self {
            place,
            id: AuthorId(place as u32),
            last,
            is_operator,
            returning,
            keeps,
            backlog: None,
            calm_us,
            dies_us,
            back_us: None,
            writer: Some(Writer::new(place, now)),
            ends: None,
            past: Vec::new(),
            past_written: 0,
            returns: 0,
        }
    }

    pub(super) fn place(&self) -> usize {
        self.place
    }

    pub(super) fn id(&self) -> AuthorId {
        self.id
    }

    /// How often it has come back.
    pub(super) fn returns(&self) -> u64 {
        self.returns
    }

    /// All runs; the last one may still be running.
    pub(super) fn runs(&self) -> impl Iterator<Item = Run> + '_ {
        let past = self.past.iter().map(|run| Run { written: run.written.clone(), ..*run });
        past.chain(self.writer.iter().map(|writer| Run::of(writer, false)))
    }

    /// Whether it has a disk and so uses no number twice.
    pub(super) fn keeps(&self) -> bool {
        self.keeps
    }

    fn written(&self) -> u64 {
        self.past_written + self.writer.as_ref().map_or(0, |writer| writer.written().len() as u64)
    }

    pub(super) fn is_done(&self) -> bool {
        match &self.writer {
            Some(writer) => self.written() == self.last && writer.is_idle(),
            None => self.back_us.is_none(),
        }
    }

    pub(super) fn progress(&self) -> String {
        let acknowledged = self.writer.as_ref().map_or(0, Writer::acknowledged);
        format!("{} of {} written, acknowledged to {acknowledged}", self.written(), self.last)
    }

    /// A first run is never refused, and neither is an explorer that keeps its increments: nobody
    /// else has its name.
    pub(super) fn receive(&mut self, message: Message, now: Instant) -> Result<(), Violation> {
        let Some(writer) = self.writer.as_mut().filter(|_| self.ends.is_none()) else { return Ok(()) };
        if let Err(end) = writer.receive(message, now) {
            if self.returns == 0 || self.keeps {
                return Err(Violation::Failed(format!("author {}, who gives no number twice, was refused", self.id)));
            }
            self.ends = Some(end);
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
        if let Some(end) = self.ends.take() {
            self.end(end, now_us, rng);
        }
        if self.back_us.is_some_and(|back_us| now_us >= back_us) {
            self.come_back(now, now_us, rng);
        }
        let Some(writer) = &mut self.writer else { return Vec::new() };
        let chance = if self.is_operator { WRITE_CHANCE / 5.0 } else { WRITE_CHANCE };
        let count = self.past_written + writer.written().len() as u64;
        if count < self.last && writer.may_write(now_us) && rng.random_bool(chance) {
            let mut ops: Vec<Op> = (0..rng.random_range(1..4)).map(|_| op(rng)).collect();
            if let Some(head) = head.filter(|_| self.is_operator) {
                ops.extend(release_ops(self.id, count, rng, head));
            }
            writer.write(ops, now_us);
        }
        // What was just written may be on the disk without ever having been put.
        if self.dies_us.take_if(|dies_us| now_us >= *dies_us).is_some() {
            self.end(End::Killed, now_us, rng);
            return Vec::new();
        }
        let sent = writer.act(now, now_us, rng).unwrap_or_else(|end| {
            self.ends = Some(end);
            Vec::new()
        });
        if self.keeps && writer.has_delivered() {
            // The next run has everything that this one made acknowledged.
            self.past.iter_mut().for_each(|run| run.acknowledged = run.last());
        }
        sent
    }

    fn end(&mut self, end: End, now_us: u64, rng: &mut ChaCha8Rng) {
        let Some(writer) = self.writer.take() else { return };
        self.past_written += writer.written().len() as u64;
        self.past.push(Run::of(&writer, end == End::Told));
        self.backlog = self.keeps.then(|| writer.backlog(rng));
        let is_back = end != End::Killed || rng.random_bool(self.returning);
        self.back_us = is_back.then(|| now_us + rng.random_range(AWAY_US.0..AWAY_US.1));
    }

    fn come_back(&mut self, now: Instant, now_us: u64, rng: &mut ChaCha8Rng) {
        self.returns += 1;
        self.back_us = None;
        self.writer = Some(Writer::again(self.place, self.returns, self.backlog.clone(), now));
        let dies = now_us < self.calm_us && rng.random_bool(DYING_AGAIN);
        self.dies_us = dies.then(|| rng.random_range(now_us..self.calm_us.min(now_us + AGAIN_US)));
    }
}

/// The operator's extra operations: a release of what the server says it has, and now and then
/// which release robots are to use, the latest or the newest state.
fn release_ops(author: AuthorId, written: u64, rng: &mut ChaCha8Rng, head: &Head) -> Vec<Op> {
    let mut ops = Vec::new();
    let release = Release { vector: head.vector.clone(), digest: head.digest };
    let name: Option<ReleaseName> = format!("r.{}", written / 2).parse().ok();
    if rng.random_bool(0.3) {
        let made = format!("r.{}", (written / 2).saturating_sub(1)).parse().ok();
        let made = made.filter(|_| rng.random_bool(0.8)).map(|name| ReleaseId { author, name });
        ops.push(Op::Enable { release: made });
    }
    ops.extend(name.map(|name| Op::PutRelease { name, release }));
    ops
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
