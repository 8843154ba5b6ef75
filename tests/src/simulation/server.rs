//! The server: what comes in goes through the real intake onto a disk that may fail; questions are answered from the real catalog and log.

use super::disk::Disk;
use super::{EVERYBODY, Message, SERVER, Violation, map, unpack};
use fht_proto::keys::{Key, Topic};
use fht_proto::query::Head;
use fht_proto::request::parse;
use fht_proto::{Digest, Release};
use map_server::answer::{Answer, Sources, answer};
use map_server::basis::state_at;
use map_server::catalog::Catalog;
use map_server::check::Arrival;
use map_server::config::{AnswerConfig, Limits};
use map_server::fleet::Fleet;
use map_server::ingest::Ingest;
use map_server::live::LiveRules;
use map_server::log::IncrementLog;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What runs until the machine fails.
struct Running {
    ingest: Ingest,
    sources: Sources,
    arrivals: Vec<Arrival>,
    questions: Vec<(usize, Message)>,
}

pub(super) struct Server {
    disk: Arc<Disk>,
    /// None while the machine is down.
    running: Option<Running>,
    up_at_us: u64,
    is_calm: bool,
    folded: u64,
    /// The releases as they were first seen; none for those of states that had been folded away before the release came.
    releases: BTreeMap<String, Option<Release>>,
}

/// How long a machine takes to come back, seconds, at most.
const DOWN_S: u64 = 5;
/// Chance of folding the log in a step.
const FOLD_CHANCE: f64 = 0.002;
/// Clocks of the explorers start at 0; nobody is ahead of this.
const WALL_US: u64 = 1_795_000_000_000_000;

impl Server {
    pub(super) fn new(disk: Disk) -> Self {
        let disk = Arc::new(disk);
        Self { disk, running: None, up_at_us: 0, is_calm: false, folded: 0, releases: BTreeMap::new() }
    }

    pub(super) fn calm(&mut self) {
        self.is_calm = true;
        self.disk.calm();
    }

    pub(super) fn disk(&self) -> &Disk {
        &self.disk
    }

    pub(super) fn crashes(&self) -> u64 {
        self.disk.crashes()
    }

    pub(super) fn folded(&self) -> u64 {
        self.folded
    }

    pub(super) fn releases(&self) -> usize {
        self.releases.values().flatten().count()
    }

    pub(super) fn head(&self) -> Option<Arc<Head>> {
        self.running.as_ref()?.sources.catalog.view(&map()).map(|view| view.head)
    }

    /// What robots are to run: the digest of the release that is enabled, or none for the newest state. Nothing is said of a release that
    /// cannot be had: robots go on with what they ran.
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

    fn start(&self) -> Result<Running, Violation> {
        let failed =
            |error: map_server::log::StoreError| Violation::Failed(format!("the server does not start: {error}"));
        let catalog = Arc::new(Catalog::load(self.disk.as_ref()).map_err(failed)?);
        let log: Arc<dyn IncrementLog> = Arc::clone(&self.disk) as _;
        let sources = Sources {
            catalog: Arc::clone(&catalog),
            log: Arc::clone(&log),
            live: Arc::new(LiveRules::default()),
            fleet: Arc::new(Fleet::default()),
            config: Arc::new(AnswerConfig::default()),
        };
        let ingest = Ingest::new(log, catalog, Limits::default());
        Ok(Running { ingest, sources, arrivals: Vec::new(), questions: Vec::new() })
    }

    /// What everybody is sent, and what those who asked are answered.
    pub(super) fn act(&mut self, now_us: u64, rng: &mut ChaCha8Rng) -> Result<Vec<(usize, usize, Message)>, Violation> {
        if self.running.is_none() && (now_us >= self.up_at_us || self.is_calm) {
            self.running = Some(self.start()?);
        }
        let Some(running) = &mut self.running else { return Ok(Vec::new()) };
        let mut sent = Vec::new();
        let arrivals = std::mem::take(&mut running.arrivals);
        let has_failed = match running.ingest.take(arrivals, WALL_US) {
            Ok(taken) => {
                if let Some(notice) = taken.notices.first().filter(|notice| notice.reply.code.is_permanent_refusal()) {
                    return Err(Violation::Failed(format!("an honest writer was refused: {}", notice.reply)));
                }
                if !taken.announce.is_empty()
                    && let Some(view) = running.sources.catalog.view(&map())
                {
                    sent.push((SERVER, EVERYBODY, Message::Head(view.head)));
                }
                false
            }
            Err(_) => true,
        };
        let folds = !has_failed && rng.random_bool(FOLD_CHANCE);
        let has_failed = has_failed
            || folds
                && match running.ingest.retain(&map(), rng.random_range(0..40)) {
                    Ok(retained) => {
                        self.folded += u64::from(retained.is_some_and(|retained| retained.folded > 0));
                        false
                    }
                    Err(_) => true,
                };
        if has_failed {
            self.running = None;
            self.up_at_us = now_us + 1_000_000 * rng.random_range(0..=DOWN_S);
            return Ok(Vec::new());
        }
        for (from, question) in std::mem::take(&mut running.questions) {
            sent.extend(answers(&running.sources, question)?.into_iter().map(|message| (SERVER, from, message)));
        }
        self.note_releases()?;
        Ok(sent)
    }

    /// A release is what it was when it was first seen.
    fn note_releases(&mut self) -> Result<(), Violation> {
        let Some(view) = self.running.as_ref().and_then(|running| running.sources.catalog.view(&map())) else {
            return Ok(());
        };
        for release in view.state.annotations().releases() {
            let id = release.id.to_string();
            let first = match self.releases.get(&id) {
                Some(first) => first,
                None => {
                    let floor = self.disk.floor(&map()).map_err(|error| Violation::Failed(error.to_string()))?;
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

    /// Every release adds up to what it was made of.
    pub(super) fn check_releases(&self) -> Result<(), Violation> {
        for (id, release) in &self.releases {
            let Some(release) = release else { continue };
            let state = state_at(&map(), &release.vector, self.disk.as_ref());
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

/// What a question is answered with, over the text forms that travel.
fn answers(sources: &Sources, question: Message) -> Result<Vec<Message>, Violation> {
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
