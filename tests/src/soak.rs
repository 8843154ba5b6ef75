//! A fleet for an hour: robots that come and go, a map that changes, zones that come and go,
//! reports of blocked places, and a server that is killed every ten minutes and starts again.
//!
//! A run must show that nothing acknowledged is lost, and that the server's memory, its files and
//! the time of an answer do not grow.
//!
//! | module | idea |
//! | --- | --- |
//! | `robots` | a part of the fleet, in a process of its own |
//! | `people` | who writes the map, draws zones and has old increments folded |
//! | `place` | the map that all are on |
//! | `report` | what was measured, minute by minute |

mod people;
mod place;
mod report;
pub mod robots;

pub use report::{Minute, SoakReport};

use crate::fleet::processes::parts;
use crate::fleet::usage;
use crate::maps::hall;
use crate::trial::TrialError;
use crate::upload::upload_map;
use fht_client::{LiveReplica, ReplicaConfig, ask_head};
use fht_demo::{Process, free_endpoint};
use fht_session::SessionConfig;
use people::Acknowledged;
use place::{SIDE, map};
use robots::RobotActivity;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long the server may take to start, and a copy to be the server's map in the end.
const PATIENCE: Duration = Duration::from_secs(60);
/// Between two looks at the server.
const MINUTE: Duration = Duration::from_secs(60);

/// How a run goes.
#[derive(Clone, Debug)]
pub struct SoakConfig {
    /// This program, which has all roles.
    pub executable: PathBuf,
    /// Where the server keeps its maps.
    pub folder: PathBuf,
    /// How many robots. Default 500.
    pub robots: usize,
    /// How long. Default an hour.
    pub duration: Duration,
    /// How long a server lives. Default ten minutes.
    pub kill_every: Duration,
    /// Questions of each robot, a second. Default 0.1.
    pub questions_per_s: f64,
}

impl SoakConfig {
    /// The usual run.
    #[must_use]
    pub fn new(executable: PathBuf, folder: PathBuf) -> Self {
        let (duration, kill_every) = (Duration::from_secs(3600), Duration::from_secs(600));
        Self { executable, folder, robots: 500, duration, kill_every, questions_per_s: 0.1 }
    }
}

/// Runs a soak. `say` receives each minute.
///
/// # Errors
/// [`TrialError`].
pub fn run(config: &SoakConfig, mut say: impl FnMut(&Minute)) -> Result<SoakReport, TrialError> {
    let endpoint = free_endpoint()?;
    let data = config.folder.join("data");
    let start = || Process::map_server(&config.executable, &data, &endpoint, PATIENCE);
    let mut server = start()?;
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let open = || runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None)));
    let session = open()?;
    upload_map(&session, &map(), &hall(SIDE, SIDE))?;

    let (is_over, acknowledged) = (Arc::new(AtomicBool::new(false)), Arc::new(Acknowledged::default()));
    let shared = || (session.clone(), Arc::clone(&acknowledged), Arc::clone(&is_over));
    let (writing, watch, end) = shared();
    let explorer = runtime.spawn(people::explore(writing, watch, end));
    let (writing, watch, end) = shared();
    let operator = runtime.spawn(people::operate(writing, watch, end));
    let windows = Arc::new(Mutex::new(Vec::new()));
    let mut fleet = Vec::new();
    for (first, count) in parts(config.robots) {
        let process = Process::run("the robots", robots_of(config, &endpoint, first, count))?;
        fleet.push(follow(process, Arc::clone(&windows)));
    }

    let mut report = SoakReport { robots: config.robots, ..SoakReport::default() };
    // From when all robots are there.
    while lock(&windows).len() < fleet.len() {
        std::thread::sleep(Duration::from_secs(1));
    }
    lock(&windows).clear();
    let (begin, mut killed) = (Instant::now(), Instant::now());
    for minute in (1..).take_while(|minute| MINUTE * *minute <= config.duration) {
        let is_killed = killed.elapsed() >= config.kill_every;
        if is_killed {
            server.kill()?;
            server = start()?;
            killed = Instant::now();
        }
        std::thread::sleep((MINUTE * minute).saturating_sub(begin.elapsed()));
        let minute = Minute {
            at_s: begin.elapsed().as_secs_f64(),
            is_killed,
            server_bytes: usage::resident_bytes(server.id()).unwrap_or(0),
            open_files: open_files(server.id()),
            stored_bytes: bytes_in(&data),
            ..Minute::of(&std::mem::take(&mut *lock(&windows)))
        };
        say(&minute);
        report.minutes.push(minute);
    }
    is_over.store(true, Ordering::Relaxed);
    for task in [explorer, operator] {
        runtime.block_on(task).map_err(|_| TrialError::NoReport)?;
    }
    let head = ask_head(&session, &map(), PATIENCE)?;
    let copy = LiveReplica::start(&session, &map(), "witness", ReplicaConfig::default())?;
    let has_come = copy.wait_for(&head.vector, PATIENCE);
    report.agree = has_come && copy.read().state().digest() == head.digest;
    (report.acknowledged, report.lost) = acknowledged.lost(&head.vector);
    report.not_acknowledged = acknowledged.failures();
    Ok(report)
}

fn robots_of(config: &SoakConfig, endpoint: &str, first: usize, count: usize) -> Command {
    let mut command = Command::new(&config.executable);
    let rate = config.questions_per_s.to_string();
    command.args(["role", robots::NAME, endpoint, &first.to_string(), &count.to_string(), &rate]);
    command
}

/// Reads what robots report, in a thread of its own.
fn follow(process: Process, windows: Arc<Mutex<Vec<RobotActivity>>>) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let take = |line: &str| match serde_json::from_str::<RobotActivity>(line) {
            Ok(window) => lock(&windows).push(window),
            Err(error) => tracing::warn!("not understood: {error}: {line}"),
        };
        if let Err(error) = process.follow(take) {
            tracing::warn!("{error}");
        }
    })
}

// Whole operations under the lock.
fn lock(windows: &Mutex<Vec<RobotActivity>>) -> std::sync::MutexGuard<'_, Vec<RobotActivity>> {
    windows.lock().unwrap_or_else(PoisonError::into_inner)
}

fn bytes_in(folder: &Path) -> u64 {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    files.filter_map(|file| file.metadata().ok()).map(|file| file.len()).sum()
}

/// How many files and sockets a process has open.
fn open_files(process: u32) -> usize {
    std::fs::read_dir(format!("/proc/{process}/fd")).map_or(0, Iterator::count)
}
