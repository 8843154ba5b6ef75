//! Many clients in one process. Each has its own session and live copy of the map, and all ask at a
//! steady rate. Whoever has started the process tells it when to take the next step, on its
//! standard input.

use crate::fleet::latencies::Latencies;
use crate::fleet::server::bare_selector;
use crate::trial::TrialError;
use fht_client::{LiveReplica, ReplicaConfig, ask, ask_head};
use fht_map::{FreeSpace, MapState, SpaceConfig};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::PathReply;
use fht_proto::{FixedPoint, MapName};
use fht_session::SessionConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::io::BufRead;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use zenoh::query::Reply;
use zenoh::{Session, Wait};

/// How long the whole fleet may take to join, to catch up, or to be answered at the end. Zenoh's
/// routers look at all sessions at each declaration, so that joining takes time by the square of
/// the clients.
const PATIENCE: Duration = Duration::from_secs(600);
/// How long one answer may take.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// How many sessions are opened at a time.
const OPENING: usize = 8;
/// How many clients fetch the map at a time.
const JOINING: usize = 50;
/// How many pairs of places are asked for in turn.
const PAIRS: usize = 500;
/// One of so many replies is fully decoded; all are checked.
const READ_EVERY: u64 = 64;

/// A kind of question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A path on the map.
    Path,
    /// The same number of bytes from the bare queryable.
    Bare,
}

/// What clients do.
#[derive(Clone, Debug)]
pub struct ClientsConfig {
    /// The server.
    pub endpoint: String,
    /// Zenoh's configuration of all sessions.
    pub zenoh_config: PathBuf,
    /// The map.
    pub map: MapName,
    /// The number of the first client.
    pub first: usize,
    /// How many clients.
    pub clients: usize,
    /// Their copies ask for the head this often, seconds.
    pub head_every_s: f64,
    /// Questions of each client, per second.
    pub rate_hz: f64,
    /// How long each kind is asked before anything counts, seconds.
    pub warm_up_s: f64,
    /// How long each kind is asked, seconds.
    pub seconds: f64,
    /// The kinds take turns of this length, seconds.
    pub turn_s: f64,
    /// Questions of a single client that waits for each answer, of each kind in turn, at the end.
    pub alone: usize,
    /// Seed of the places.
    pub seed: u64,
}

/// The results for one kind of question.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Questions asked.
    pub asked: u64,
    /// Refusals and unreadable answers.
    pub errors: u64,
    /// Questions that ended without an answer.
    pub unanswered: u64,
    /// Time from asking to having the answer.
    pub latencies: Latencies,
    /// How late questions were asked: the generator may not keep up.
    pub late: Latencies,
    /// Bytes of the answers.
    pub bytes: u64,
}

impl Outcome {
    fn add(&mut self, other: &Self) {
        self.asked += other.asked;
        self.errors += other.errors;
        self.unanswered += other.unanswered;
        self.latencies.add_all(&other.latencies);
        self.late.add_all(&other.late);
        self.bytes += other.bytes;
    }
}

/// What clients that have the map do next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Ask, but nothing counts yet.
    WarmUp(Kind),
    /// Ask for a turn.
    Turn(Kind),
    /// Compare the copies, and report.
    End,
}

/// What the clients say while they run.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// They have the map, have done all before this step, and take it when they are told to.
    Ready(Step),
    /// The results.
    Report(Box<Report>),
}

/// The clients' results.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Report {
    /// Paths.
    pub path: Outcome,
    /// Bare queries.
    pub bare: Outcome,
    /// Paths for a single client.
    pub path_alone: Latencies,
    /// Bare queries for a single client.
    pub bare_alone: Latencies,
    /// Copies that equal the server's map in the end.
    pub copies_agree: usize,
    /// Version of the map in the end.
    pub version: u64,
}

impl Report {
    /// Adds that of other clients.
    pub fn add(&mut self, other: &Self) {
        self.path.add(&other.path);
        self.bare.add(&other.bare);
        self.path_alone.add_all(&other.path_alone);
        self.bare_alone.add_all(&other.bare_alone);
        self.copies_agree += other.copies_agree;
        self.version = self.version.max(other.version);
    }
}

/// Counts the answers to one kind of question.
#[derive(Debug, Default)]
struct Tally {
    outcome: Mutex<Outcome>,
    under_way: AtomicU64,
}

/// A question under way.
struct Asked {
    at: Instant,
    is_answered: AtomicBool,
    is_read: bool,
    tally: Arc<Tally>,
}

impl Tally {
    fn with(&self, change: impl FnOnce(&mut Outcome)) {
        change(&mut self.outcome.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Asked {
    fn take_reply(&self, reply: &Reply) {
        let took = self.at.elapsed();
        self.is_answered.store(true, Ordering::Relaxed);
        let bytes = reply.result().map_or(0, |sample| sample.payload().len());
        let is_good = match reply.result() {
            Ok(sample) if self.is_read => serde_json::from_slice::<PathReply>(&sample.payload().to_bytes()).is_ok(),
            Ok(_) => bytes > 0,
            Err(_) => false,
        };
        self.tally.with(|outcome| {
            outcome.bytes += bytes as u64;
            if is_good {
                outcome.latencies.add(took);
            } else {
                outcome.errors += 1;
            }
        });
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        if !self.is_answered.load(Ordering::Relaxed) {
            self.tally.with(|outcome| outcome.unanswered += 1);
        }
        self.tally.under_way.fetch_sub(1, Ordering::AcqRel);
    }
}

/// A question, and the bare question whose answer is as long.
struct Pair {
    path: String,
    bare: String,
}

impl Pair {
    fn selector(&self, kind: Kind) -> &str {
        match kind {
            Kind::Path => &self.path,
            Kind::Bare => &self.bare,
        }
    }
}

/// Runs the clients; `say` receives what they say, and a line of `told` has them take the step
/// that they are ready for.
///
/// # Errors
/// [`TrialError`]. Unanswered questions are a result, not an error.
pub fn run(config: &ClientsConfig, told: impl BufRead, mut say: impl FnMut(&Event)) -> Result<(), TrialError> {
    let mut told = told.lines();
    let mut ready = |step| {
        say(&Event::Ready(step));
        told.next().transpose()?.map(|_| ()).ok_or(TrialError::Late("the next step did not come"))
    };
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let sessions = runtime.block_on(open_all(config))?;
    let first = sessions.first().ok_or(TrialError::Late("a client did not get the map"))?;
    let vector = ask_head(first, &config.map, PATIENCE)?.vector;
    let copying = ReplicaConfig { head_every_s: config.head_every_s, ..ReplicaConfig::default() };
    let mut replicas = Vec::new();
    // Not all at once: who waits too long for a server asks again, and keeps it from the others.
    for joining in sessions.chunks(JOINING) {
        let count = replicas.len();
        for (number, session) in (config.first + count..).zip(joining) {
            let name = format!("fleet-{number}");
            replicas.push(LiveReplica::start(session, &config.map, &name, copying.clone())?);
        }
        if !replicas.iter().skip(count).all(|replica| replica.wait_for(&vector, PATIENCE)) {
            return Err(TrialError::Late("a client did not get the map"));
        }
    }
    let pairs = pairs(config, first, &replicas[0].running())?;
    let kinds = [Kind::Path, Kind::Bare];
    for kind in kinds {
        ready(Step::WarmUp(kind))?;
        ask_all(config, &sessions, &pairs, kind, config.warm_up_s, &Arc::default());
    }
    let tallies = kinds.map(|_| Arc::<Tally>::default());
    let mut left_s = config.seconds;
    while left_s > 0.0 {
        let turn_s = config.turn_s.min(left_s);
        for (kind, tally) in kinds.into_iter().zip(&tallies) {
            ready(Step::Turn(kind))?;
            ask_all(config, &sessions, &pairs, kind, turn_s, tally);
        }
        left_s -= turn_s.max(0.001);
    }
    ready(Step::End)?;
    let mut report = Report::default();
    for (kind, tally) in kinds.into_iter().zip(&tallies) {
        let outcome = tally.outcome.lock().unwrap_or_else(PoisonError::into_inner).clone();
        *if kind == Kind::Path { &mut report.path } else { &mut report.bare } = outcome;
    }
    (report.path_alone, report.bare_alone) = ask_alone(first, &pairs, config.alone)?;
    let head = ask_head(first, &config.map, PATIENCE)?;
    report.version = head.version;
    report.copies_agree = replicas.iter().filter(|replica| agrees(replica, first, &config.map)).count();
    say(&Event::Report(Box::new(report)));
    drop(replicas);
    for session in sessions {
        session.close().wait()?;
    }
    Ok(())
}

async fn open_all(config: &ClientsConfig) -> Result<Vec<Session>, TrialError> {
    let link = SessionConfig::from_options(vec![config.endpoint.clone()], Some(config.zenoh_config.clone()));
    let mut sessions = Vec::new();
    while sessions.len() < config.clients {
        let mut opening = tokio::task::JoinSet::new();
        for _ in 0..OPENING.min(config.clients - sessions.len()) {
            let link = link.clone();
            opening.spawn(async move { fht_session::open_within(&link, Some(PATIENCE)).await });
        }
        for session in opening.join_all().await {
            sessions.push(session?);
        }
    }
    Ok(sessions)
}

/// Whether a copy equals the server's map at some moment, since others may be writing.
fn agrees(replica: &LiveReplica, session: &Session, map: &MapName) -> bool {
    (0..20).any(|_| {
        let Ok(head) = ask_head(session, map, ANSWER_TIMEOUT) else { return false };
        let has_come = replica.wait_for(&head.vector, ANSWER_TIMEOUT);
        let copy = replica.read();
        has_come && *copy.vector() == head.vector && copy.state().digest() == head.digest
    })
}

/// Pairs of places in free space; each is asked for once to learn the length of the answer.
fn pairs(config: &ClientsConfig, session: &Session, map: &MapState) -> Result<Vec<Pair>, TrialError> {
    let space = FreeSpace::of(map, &SpaceConfig::default());
    let places: Vec<FixedPoint> =
        map.nodes().map(|node| node.pose.position).filter(|place| space.contains(*place)).collect();
    if places.is_empty() {
        return Err(TrialError::NoSpace);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut draw = || {
        let node = places[rng.random_range(0..places.len())];
        // Beside a node, if there is room.
        let mut off = |mm: i32| mm + rng.random_range(-400..=400);
        let beside = FixedPoint { x_mm: off(node.x_mm), y_mm: off(node.y_mm) };
        let place = if space.contains(beside) { beside } else { node };
        format!("{:.3},{:.3}", place.x(), place.y())
    };
    let topic = Key::topic(&config.map, Topic::Path);
    let mut pairs = Vec::new();
    for _ in 0..PAIRS {
        let path = format!("{topic}?from={};to={}", draw(), draw());
        let answer = ask(session, &path, PATIENCE)?.pop().unwrap_or_default();
        serde_json::from_slice::<PathReply>(&answer).map_err(|error| TrialError::Answer(error.to_string()))?;
        pairs.push(Pair { path, bare: bare_selector(answer.len()) });
    }
    Ok(pairs)
}

/// All clients ask at their rate, evenly spread, for `seconds`, whether they are answered or not.
/// Then waits for the answers.
fn ask_all(config: &ClientsConfig, sessions: &[Session], pairs: &[Pair], kind: Kind, seconds: f64, tally: &Arc<Tally>) {
    let interval_s = 1.0 / (config.rate_hz * sessions.len() as f64);
    let count = (seconds / interval_s).round() as u64;
    let begin = Instant::now();
    for (number, session) in (0..count).zip(sessions.iter().cycle()) {
        let due = begin + Duration::from_secs_f64(number as f64 * interval_s);
        let early = due.saturating_duration_since(Instant::now());
        if !early.is_zero() {
            std::thread::sleep(early);
        }
        let pair = &pairs[number as usize % pairs.len()];
        let is_read = kind == Kind::Path && number.is_multiple_of(READ_EVERY);
        tally.under_way.fetch_add(1, Ordering::AcqRel);
        let at = Instant::now();
        let asked = Asked { at, is_answered: AtomicBool::new(false), is_read, tally: Arc::clone(tally) };
        tally.with(|outcome| {
            outcome.asked += 1;
            outcome.late.add(at.saturating_duration_since(due));
        });
        let get = session.get(pair.selector(kind)).timeout(ANSWER_TIMEOUT);
        // A question that cannot be sent drops the callback, and counts as unanswered.
        let _ = get.callback(move |reply| asked.take_reply(&reply)).wait();
    }
    let deadline = Instant::now() + PATIENCE;
    while tally.under_way.load(Ordering::Acquire) > 0 && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A single client that waits for each answer, of both kinds in turn: the time until the program
/// has the answer.
fn ask_alone(session: &Session, pairs: &[Pair], count: usize) -> Result<(Latencies, Latencies), TrialError> {
    let mut latencies = (Latencies::default(), Latencies::default());
    let timed = |selector: &str| -> Result<Duration, TrialError> {
        let at = Instant::now();
        ask(session, selector, ANSWER_TIMEOUT)?;
        Ok(at.elapsed())
    };
    for (number, pair) in (0..count).zip(pairs.iter().cycle()) {
        // Alternates which kind comes first.
        if number % 2 == 0 {
            latencies.0.add(timed(&pair.path)?);
            latencies.1.add(timed(&pair.bare)?);
        } else {
            latencies.1.add(timed(&pair.bare)?);
            latencies.0.add(timed(&pair.path)?);
        }
    }
    Ok(latencies)
}
