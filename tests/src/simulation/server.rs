//! A server: increments go through the real ingest, onto a disk that may fail or into storages that
//! may; questions are answered from the real catalog and log.

use crate::simulation::disk::Disk;
use crate::simulation::ledger::Ledger;
use crate::simulation::message::{EVERYBODY, Message, map, unpack};
use crate::simulation::outcome::Violation;
use crate::simulation::refused::Refused;
use crate::simulation::storages::Site;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorCode, Head};
use fht_proto::api::request::parse;
use fht_proto::{AuthorId, Digest, Increment, Release, VersionVector, encode};
use map_server::catalog::{Catalog, state_at};
use map_server::config::{AnswerConfig, GapFillConfig, Limits};
use map_server::ingest::{Arrival, Ingest};
use map_server::query::{ActiveRules, Answer, AnswerSources, Fleet, answer};
use map_server::replicated::{GapFill, QuorumLog, restore, settle_disputed};
use map_server::store::{IncrementLog, StoreError, Stored};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What a server stands on.
pub(super) enum Ground {
    /// A disk of its own.
    Disk(Arc<Disk>),
    /// The storages of a site that it shares with others.
    Site(Site),
}

/// What runs until the machine fails.
struct Running {
    ingest: Ingest,
    sources: AnswerSources,
    arrivals: Vec<Arrival>,
    questions: Vec<(usize, Message)>,
    gaps: GapFill,
    next_gap_fill_us: u64,
    refused: Refused,
    /// How far its heads have been noted in the ledger.
    covered: VersionVector,
}

pub(super) struct Server {
    place: usize,
    ground: Ground,
    /// None while the machine is down.
    running: Option<Running>,
    up_at_us: u64,
    is_calm: bool,
    compactions: u64,
    crashes: u64,
    /// How often it gave way because storages hold another increment.
    overruled: u64,
    /// The releases as they were first seen; none if their states had been compacted away before
    /// the release arrived.
    releases: BTreeMap<String, Option<Release>>,
}

/// How long a machine takes to come back, seconds, at most.
const DOWN_S: u64 = 5;
/// Chance of compacting the log in a step.
const COMPACT_CHANCE: f64 = 0.002;
/// Chance that a server without a disk is killed in a step.
const KILL_CHANCE: f64 = 0.0005;
/// How often such a server looks for gaps, microseconds.
const GAP_FILL_EVERY_US: u64 = 1_000_000;
/// The server's clock. Explorers' clocks start at 0, so none of them is ahead of it.
const WALL_US: u64 = 1_795_000_000_000_000;

impl Server {
    pub(super) fn new(place: usize, ground: Ground) -> Self {
        Self {
            place,
            ground,
            running: None,
            up_at_us: 0,
            is_calm: false,
            compactions: 0,
            crashes: 0,
            overruled: 0,
            releases: BTreeMap::new(),
        }
    }

    pub(super) fn calm(&mut self) {
        self.is_calm = true;
        match &self.ground {
            Ground::Disk(disk) => disk.calm(),
            Ground::Site(site) => site.calm(),
        }
    }

    pub(super) fn place(&self) -> usize {
        self.place
    }

    pub(super) fn is_running(&self) -> bool {
        self.running.is_some()
    }

    /// What it has under a number, compacted or not.
    pub(super) fn stored(&self, author: AuthorId, number: u64) -> Option<Vec<u8>> {
        match &self.ground {
            Ground::Disk(disk) => disk.stored(author, number),
            Ground::Site(_) => match self.running.as_ref()?.sources.log.reader().stored(&map(), author, number) {
                Ok(Stored::Increment(bytes)) => Some(bytes),
                _ => None,
            },
        }
    }

    /// Whether an acknowledged increment is where it must be.
    pub(super) fn holds(&self, increment: &Increment) -> bool {
        let has = || self.stored(increment.author, increment.number);
        let is_here = encode(increment).is_ok_and(|bytes| has().is_some_and(|has| has == bytes));
        match &self.ground {
            Ground::Disk(_) => is_here,
            Ground::Site(site) => is_here && site.copies(increment) >= Site::quorum().confirm,
        }
    }

    pub(super) fn overruled(&self) -> u64 {
        self.overruled
    }

    /// Notes in the ledger what its head covers now.
    pub(super) fn note_covered(&mut self, ledger: &mut Ledger) -> Result<(), Violation> {
        let Some(head) = self.head() else { return Ok(()) };
        if let Some(running) = &self.running {
            ledger.cover(&running.covered, &head.vector, |author, number| self.stored(author, number))?;
        }
        if let Some(running) = &mut self.running {
            running.covered = head.vector.clone();
        }
        Ok(())
    }

    pub(super) fn crashes(&self) -> u64 {
        match &self.ground {
            Ground::Disk(disk) => disk.crashes(),
            Ground::Site(_) => self.crashes,
        }
    }

    pub(super) fn compactions(&self) -> u64 {
        self.compactions
    }

    pub(super) fn releases(&self) -> usize {
        self.releases.values().flatten().count()
    }

    pub(super) fn head(&self) -> Option<Arc<Head>> {
        self.running.as_ref()?.sources.catalog.view(&map()).map(|view| view.head)
    }

    /// What robots should run: the digest of the enabled release, or none for the newest state.
    /// Unknown while the release is not available: robots go on with what they ran.
    pub(super) fn runs(&self) -> Option<Option<Digest>> {
        let view = self.running.as_ref()?.sources.catalog.view(&map())?;
        match view.state.annotations().enabled() {
            None => Some(None),
            Some(enabled) if view.running.release() == Some(enabled.id) => Some(Some(enabled.release.digest)),
            Some(_) => None,
        }
    }

    pub(super) fn receive(&mut self, from: usize, message: Message) {
        let Some(running) = &mut self.running else { return };
        match message {
            Message::Put { key, bytes } => running.arrivals.push(Arrival { key, payload: Ok(bytes.as_ref().clone()) }),
            question => running.questions.push((from, question)),
        }
    }

    /// Starts the server; `None` if it cannot reach what it needs yet.
    fn start(&self, now_us: u64) -> Result<Option<Running>, Violation> {
        let failed = |error: StoreError| Violation::Failed(format!("the server does not start: {error}"));
        let (log, catalog): (Arc<dyn IncrementLog>, Arc<Catalog>) = match &self.ground {
            Ground::Disk(disk) => (Arc::clone(disk) as _, Arc::new(Catalog::load(disk.as_ref()).map_err(failed)?)),
            Ground::Site(site) => {
                (Arc::new(QuorumLog::new(site.seen_by(self.place), Site::quorum())), Arc::new(Catalog::default()))
            }
        };
        let sources = AnswerSources {
            writers: None,
            catalog: Arc::clone(&catalog),
            log: Arc::clone(&log),
            active_rules: Arc::new(ActiveRules::default()),
            fleet: Arc::new(Fleet::default()),
            operators: Arc::default(),
            config: Arc::new(AnswerConfig::default()),
        };
        let mut ingest = Ingest::new(log, catalog, Limits::default());
        if let Ground::Site(site) = &self.ground {
            match restore(site.seen_by(self.place).as_ref(), Site::quorum(), &mut ingest) {
                Ok(()) => {}
                Err(StoreError::Unconfirmed) => return Ok(None),
                Err(other) => return Err(failed(other)),
            }
        }
        let gaps =
            GapFill::new(GapFillConfig { part: 3, max_increments: 10, list_every: 5, ..GapFillConfig::default() });
        let (arrivals, questions) = (Vec::new(), Vec::new());
        let (refused, covered) = (Refused::new(), VersionVector::default());
        Ok(Some(Running { ingest, sources, arrivals, questions, gaps, next_gap_fill_us: now_us, refused, covered }))
    }

    /// What has arrived, if it can be kept now, and what the gap fill has found.
    fn arrivals(&mut self, now_us: u64) -> Vec<Arrival> {
        let Some(running) = &mut self.running else { return Vec::new() };
        if let Ground::Site(site) = &self.ground {
            if now_us >= running.next_gap_fill_us {
                running.next_gap_fill_us = now_us + GAP_FILL_EVERY_US;
                let heads = running.sources.catalog.heads();
                running.arrivals.extend(running.gaps.find_missing(site.seen_by(self.place).as_ref(), &heads));
            }
            if !site.is_within_reach(self.place) {
                return Vec::new();
            }
        }
        std::mem::take(&mut running.arrivals)
    }

    /// Takes in what has arrived; returns what others should hear of it. `None` when the machine
    /// fails.
    fn take_in(
        &mut self,
        arrivals: Vec<Arrival>,
        now_us: u64,
        rng: &mut ChaCha8Rng,
    ) -> Result<Option<Vec<(usize, Message)>>, Violation> {
        let vector = self.head().map(|head| head.vector.clone()).unwrap_or_default();
        let Some(running) = &mut self.running else { return Ok(Some(Vec::new())) };
        let offered = running.refused.offered(&arrivals, &vector);
        let log = Arc::clone(&running.sources.log);
        let taken = running.ingest.take_arrivals(arrivals, WALL_US).and_then(|taken| {
            if let Ground::Site(site) = &self.ground {
                settle_disputed(&taken.disputed, log.as_ref(), site.seen_by(self.place).as_ref())?;
            }
            Ok(taken)
        });
        let taken = match taken {
            Ok(taken) => taken,
            Err(StoreError::Overruled { .. }) => {
                self.overruled += 1;
                return Ok(None);
            }
            Err(_) => return Ok(None),
        };
        let is_unfair = |code: ErrorCode| code.is_permanent_refusal() && code != ErrorCode::Conflict;
        if let Some(notice) = taken.notices.iter().find(|notice| is_unfair(notice.reply.code)) {
            return Err(Violation::Failed(format!("an honest writer was refused: {}", notice.reply)));
        }
        let told = running.refused.told(offered, log.as_ref(), now_us);
        let told = told.into_iter().map(|author| (author.0 as usize, Message::Refused));
        let announced = running.sources.catalog.view(&map()).filter(|_| !taken.announce.is_empty());
        let compacts = matches!(self.ground, Ground::Disk(_)) && rng.random_bool(COMPACT_CHANCE);
        if compacts {
            match running.ingest.retain(&map(), rng.random_range(0..40)) {
                Ok(retained) => self.compactions += u64::from(retained.is_some_and(|retained| retained.folded > 0)),
                Err(_) => return Ok(None),
            }
        }
        let heads = announced.map(|view| (EVERYBODY, Message::Head(view.head)));
        Ok(Some(told.chain(heads).collect()))
    }

    /// What everybody is sent, and the answers to questions.
    pub(super) fn act(&mut self, now_us: u64, rng: &mut ChaCha8Rng) -> Result<Vec<(usize, usize, Message)>, Violation> {
        if self.running.is_none() && (now_us >= self.up_at_us || self.is_calm) {
            self.running = self.start(now_us)?;
            self.up_at_us = now_us + 1_000_000;
        }
        if self.running.is_none() {
            return Ok(Vec::new());
        }
        let arrivals = self.arrivals(now_us);
        let is_killed = matches!(self.ground, Ground::Site(_)) && !self.is_calm && rng.random_bool(KILL_CHANCE);
        let announced = self.take_in(arrivals, now_us, rng)?.filter(|_| !is_killed);
        let mut sent = Vec::new();
        if let Ground::Site(site) = &self.ground {
            // What it has put is out, whatever becomes of the server.
            for put in site.take_puts(self.place) {
                let others = (0..site.servers()).filter(|other| *other != self.place);
                sent.extend(others.map(|other| (self.place, other, put.clone())));
            }
        }
        let Some((announced, running)) = announced.zip(self.running.as_mut()) else {
            self.running = None;
            self.crashes += 1;
            self.up_at_us = now_us + 1_000_000 * rng.random_range(0..=DOWN_S);
            return Ok(sent);
        };
        sent.extend(announced.into_iter().map(|(to, message)| (self.place, to, message)));
        for (from, question) in std::mem::take(&mut running.questions) {
            sent.extend(answers(&running.sources, question)?.into_iter().map(|message| (self.place, from, message)));
        }
        self.note_releases()?;
        Ok(sent)
    }

    /// Checks that releases are what they were when they were first seen.
    fn note_releases(&mut self) -> Result<(), Violation> {
        let Some(running) = &self.running else { return Ok(()) };
        let (log, Some(view)) = (&running.sources.log, running.sources.catalog.view(&map())) else { return Ok(()) };
        for release in view.state.annotations().releases() {
            let id = release.id.to_string();
            let first = match self.releases.get(&id) {
                Some(first) => first,
                None => {
                    let floor = log.reader().floor(&map()).map_err(|error| Violation::Failed(error.to_string()))?;
                    let is_whole = release.release.vector.covers(&floor.vector);
                    self.releases.entry(id.clone()).or_insert(is_whole.then(|| release.release.clone()))
                }
            };
            if first.as_ref().is_some_and(|first| first != release.release) {
                return Err(Violation::Release(id));
            }
        }
        Ok(())
    }

    /// Checks that every release adds up to what it was made of.
    pub(super) fn check_releases(&self) -> Result<(), Violation> {
        let Some(running) = &self.running else { return Ok(()) };
        for (id, release) in &self.releases {
            let Some(release) = release else { continue };
            let state = state_at(&map(), &release.vector, running.sources.log.as_ref());
            let state = state.map_err(|error| Violation::Failed(error.to_string()))?;
            if state.is_none_or(|state| state.digest() != release.digest) {
                return Err(Violation::Release(id.clone()));
            }
        }
        Ok(())
    }
}

/// So that even small maps come in several parts.
const SMALL: [(&str, &str); 2] = [("max_bytes", "600"), ("piece_bytes", "200")];

fn pieces(id: u64, answers: Vec<Answer>) -> Result<Vec<Message>, Violation> {
    let piece = |answer: &Answer| Ok(Message::Piece { id, series: Arc::new(unpack(&answer.bytes)?) });
    let mut messages = answers.iter().map(piece).collect::<Result<Vec<_>, Violation>>()?;
    messages.push(Message::End { id });
    Ok(messages)
}

/// The answer to a question, through the text forms that travel.
fn answers(sources: &AnswerSources, question: Message) -> Result<Vec<Message>, Violation> {
    let ask = |topic: Topic, parameters: &[(&str, &str)]| {
        let key = Key::topic(&map(), topic);
        parse(key, parameters.iter().copied(), None).and_then(|request| answer(request, sources, 0))
    };
    match question {
        Message::AskHead { id } => {
            let head =
                ask(Topic::Head, &[]).ok().and_then(|answers| serde_json::from_slice(&answers.first()?.bytes).ok());
            Ok(vec![Message::HeadAnswer { id, head: head.map(Arc::new) }])
        }
        Message::AskSince { id, have } => {
            let have = have.to_string();
            pieces(id, ask(Topic::Since, &[&SMALL[..], &[("vector", &have)]].concat()).unwrap_or_default())
        }
        Message::AskAt { id, vector, have } => {
            let (vector, have) = (vector.to_string(), have.to_string());
            let parameters = [&SMALL[..], &[("vector", &vector), ("have", &have)]].concat();
            pieces(id, ask(Topic::Snapshot, &parameters).unwrap_or_default())
        }
        _ => Ok(Vec::new()),
    }
}
