//! A part of the fleet, in a process of its own: each robot has a session, a live copy of the map
//! and a token, says where it is, asks for paths, and reports what is blocked. Every few seconds
//! one leaves and another comes.

use crate::fleet::latencies::Latencies;
use crate::soak::place::{SIDE, map};
use crate::trial::TrialError;
use fht_client::{LiveReplica, PoseReport, Presence, ReplicaConfig};
use fht_proto::api::fleet::{BlockedReport, RobotRole};
use fht_proto::api::keys::{Key, Topic};
use fht_session::SessionConfig;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::runtime::Runtime;
use zenoh::liveliness::LivelinessToken;
use zenoh::query::Reply;
use zenoh::{Session, Wait};

/// The role's name on the command line.
pub const NAME: &str = "robots";
/// Between two reports to whoever started this, two robots that go, and two blocked places.
const REPORT_EVERY: Duration = Duration::from_secs(10);
const REPLACE_EVERY: Duration = Duration::from_secs(5);
const BLOCK_EVERY: Duration = Duration::from_secs(7);
/// How long a place stays blocked, seconds.
const BLOCKED_S: f64 = 20.0;
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
const PATIENCE: Duration = Duration::from_secs(300);

/// What robots did in some seconds.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RobotActivity {
    /// Paths that were asked for.
    pub asked: u64,
    /// Refused ones.
    pub refused: u64,
    /// Questions that ended without an answer.
    pub unanswered: u64,
    /// Robots that have left, each with one in its place.
    pub replaced: u64,
    /// The time of an answer.
    pub latencies: Latencies,
}

type Shared = Arc<Mutex<RobotActivity>>;

// Whole operations under the lock.
fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A question under way.
struct Asked {
    at: Instant,
    is_answered: bool,
    window: Shared,
}

impl Asked {
    fn take(&mut self, reply: &Reply) {
        self.is_answered = true;
        let mut window = lock(&self.window);
        match reply.result() {
            Ok(_) => window.latencies.add(self.at.elapsed()),
            Err(_) => window.refused += 1,
        }
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        if !self.is_answered {
            lock(&self.window).unanswered += 1;
        }
    }
}

/// A robot that has come.
struct Robot {
    session: Session,
    presence: Presence,
    copy: LiveReplica,
    token: LivelinessToken,
}

impl Robot {
    fn come(runtime: &Runtime, endpoint: &str, number: u64) -> Result<Self, TrialError> {
        let link = SessionConfig::from_options(vec![endpoint.to_owned()], None);
        let session = runtime.block_on(fht_session::open_within(&link, Some(PATIENCE)))?;
        let name = format!("soak-{number}");
        let presence = Presence::new(&session, &map(), &name, RobotRole::Client)
            .map_err(|error| TrialError::Answer(error.to_string()))?;
        let token = presence.declare()?;
        let copy = LiveReplica::start(&session, &map(), &name, ReplicaConfig::default())?;
        Ok(Self { session, presence, copy, token })
    }

    fn leave(self) -> Result<(), TrialError> {
        drop(self.copy);
        drop(self.token);
        Ok(self.session.close().wait()?)
    }

    /// Asks for a path, and says where it is.
    fn live(&self, selector: &str, window: &Shared) {
        lock(window).asked += 1;
        let asked = Mutex::new(Asked { at: Instant::now(), is_answered: false, window: Arc::clone(window) });
        // A question that cannot be sent drops the callback, and counts as unanswered.
        let _ =
            self.session.get(selector).timeout(ANSWER_TIMEOUT).callback(move |reply| lock(&asked).take(&reply)).wait();
        let vector = self.copy.read().vector().clone();
        self.presence.publish(&PoseReport::default(), vector, None);
    }
}

/// Runs `count` robots, the first of them number `first`, until this process is ended.
///
/// # Errors
/// [`TrialError`] when the first ones do not come.
pub fn run(endpoint: &str, first: u64, count: u64, questions_per_s: f64) -> Result<(), TrialError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let come = |number| Robot::come(&runtime, endpoint, number);
    let robots = Mutex::new((first..first + count).map(come).collect::<Result<Vec<Robot>, _>>()?);
    let window = Shared::default();
    std::thread::scope(|scope| {
        scope.spawn(|| report(&window));
        scope.spawn(|| replace(|turn| come(1_000_000 * (turn + 1) + first), &robots, &window));
        live(&robots, &window, count as f64 * questions_per_s, first);
    });
    Ok(())
}

/// All robots in turn, so many times a second together.
fn live(robots: &Mutex<Vec<Robot>>, window: &Shared, turns_per_s: f64, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let topic = Key::topic(&map(), Topic::Path);
    let (begin, mut blocked) = (Instant::now(), Instant::now());
    for turn in 0_usize.. {
        let due = Duration::from_secs_f64(turn as f64 / turns_per_s);
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
        let [a, b, x, y] = std::array::from_fn(|_| 2.0 * f64::from(rng.random_range(0..SIDE)));
        let robots = lock(robots);
        let robot = &robots[turn % robots.len()];
        robot.live(&format!("{topic}?from={a},{b};to={x},{y}"), window);
        if blocked.elapsed() >= BLOCK_EVERY {
            blocked = Instant::now();
            // Between nodes, so that there is always a way round.
            let places = vec![[x + 1.0, y + 1.0]];
            robot.presence.report_blocked(&BlockedReport { for_s: BLOCKED_S, edges: Vec::new(), places });
        }
    }
}

/// Prints what has happened, every ten seconds.
fn report(window: &Shared) {
    loop {
        std::thread::sleep(REPORT_EVERY);
        let taken = std::mem::take(&mut *lock(window));
        match serde_json::to_string(&taken) {
            Ok(line) => println!("{line}"),
            Err(error) => tracing::warn!("{error}"),
        }
    }
}

/// One leaves and another comes, all in turn.
fn replace(come: impl Fn(u64) -> Result<Robot, TrialError>, robots: &Mutex<Vec<Robot>>, window: &Shared) {
    for turn in 0_u64.. {
        std::thread::sleep(REPLACE_EVERY);
        let replaced = come(turn).and_then(|robot| {
            let mut robots = lock(robots);
            let place = turn as usize % robots.len();
            let gone = std::mem::replace(&mut robots[place], robot);
            drop(robots);
            gone.leave()
        });
        match replaced {
            Ok(()) => lock(window).replaced += 1,
            Err(error) => tracing::warn!("no robot in place of another: {error}"),
        }
    }
}
