//! A fleet on one server: real processes and sessions, with bare Zenoh queries beside ours in the
//! same run.
//!
//! The server is a separate process; on its session a bare queryable answers with as many bytes as
//! a path has. The clients are sessions with live copies of the map, 250 in a process. Paths and
//! bare queries take turns, so that whatever else the machine does affects both. Meanwhile the map
//! changes.

pub mod clients;
pub mod latencies;
pub mod processes;
pub mod server;
pub mod usage;

use crate::trial::TrialError;
use crate::upload::{put_increment, upload_map};
use clients::{Kind, Outcome, Report, Step};
use fht_client::ask_head;
use fht_demo::{Process, free_endpoint};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector};
use fht_session::SessionConfig;
use latencies::Latencies;
use processes::{ClientProcesses, parts};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

/// How long the server may take to start.
const PATIENCE: Duration = Duration::from_secs(60);
/// Zenoh's threads in the server, as `deploy/` sets them: the thread that waits for the sockets
/// also reads them, so no message is handed from thread to thread.
pub const SERVER_THREADS: &str = "(acc: (handover: rx), net: (handover: rx))";
/// Zenoh's threads for all clients of a process together, which share the machine with the server.
const CLIENT_THREADS: &str = "(acc: (handover: rx), net: (handover: rx), tx: (handover: rx))";
/// Zenoh's configuration of the server and all clients: while many sessions join on a busy machine,
/// a link may be silent for longer than Zenoh's own lease of 10 s.
const ZENOH: &str = "{transport: {link: {tx: {lease: 120000}}}}";
/// How often the server's memory is sampled.
const MEMORY_EVERY: Duration = Duration::from_millis(200);

/// How a run goes.
#[derive(Clone, Debug)]
pub struct FleetTrialConfig {
    /// This program, `fleet`.
    pub executable: PathBuf,
    /// The server's data directory.
    pub data: PathBuf,
    /// The map's name.
    pub map: MapName,
    /// How many clients.
    pub clients: usize,
    /// Their copies ask for the head this often, seconds; a robot's does every 2.
    pub head_every_s: f64,
    /// Questions of each client, per second.
    pub rate_hz: f64,
    /// How long each kind of question is asked, seconds.
    pub seconds: f64,
    /// The kinds take turns of this length, seconds.
    pub turn_s: f64,
    /// How long each kind is asked before anything counts, seconds.
    pub warm_up_s: f64,
    /// Questions of a single client, of each kind.
    pub alone: usize,
    /// Increments written meanwhile, per second.
    pub increments_hz: f64,
    /// Seed of the places.
    pub seed: u64,
}

/// The processor time that one kind of question took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Computed {
    /// Processor time of the server, seconds.
    pub server_s: f64,
    /// Processor time of all clients, seconds.
    pub clients_s: f64,
    /// Elapsed time, seconds.
    pub wall_s: f64,
}

/// The results.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct FleetReport {
    /// How many clients.
    pub clients: usize,
    /// Questions of each client, per second.
    pub rate_hz: f64,
    /// How long it took until all clients had the map, seconds.
    pub joined_s: f64,
    /// Paths.
    pub path: Outcome,
    /// Bare queries with answers of the same length.
    pub bare: Outcome,
    /// Processor time for paths.
    pub path_computed: Computed,
    /// Processor time for bare queries.
    pub bare_computed: Computed,
    /// Paths for a single client that waits for each answer.
    pub path_alone: Latencies,
    /// Bare queries for such a client.
    pub bare_alone: Latencies,
    /// Clients whose copies equal the server's map in the end.
    pub copies_agree: usize,
    /// Versions of the map written meanwhile.
    pub versions: u64,
    /// The server's largest resident memory during warm-up, bytes.
    pub warm_bytes: u64,
    /// The largest after that, bytes.
    pub most_bytes: u64,
    /// The server's resident memory in the end, bytes.
    pub last_bytes: u64,
    /// Load average over the last minute.
    pub load: f64,
    /// Processors of the machine.
    pub processors: usize,
}

impl FleetReport {
    /// Refusals and unanswered questions.
    #[must_use]
    pub fn failures(&self) -> u64 {
        [&self.path, &self.bare].iter().map(|outcome| outcome.errors + outcome.unanswered).sum()
    }

    /// Whether the server's memory stayed within a twentieth, or 8 MiB, of what it was after
    /// warm-up.
    #[must_use]
    pub fn memory_is_steady(&self) -> bool {
        self.most_bytes <= self.warm_bytes + (self.warm_bytes / 20).max(8 << 20)
    }

    /// The ratio of medians of paths and bare queries, for a single client.
    #[must_use]
    pub fn ratio_alone(&self) -> f64 {
        self.path_alone.quantile_ms(0.5) / self.bare_alone.quantile_ms(0.5)
    }
}

/// Runs a fleet on the map that `increments` make.
///
/// # Errors
/// [`TrialError`]. Failed questions are in the report.
pub fn run(config: &FleetTrialConfig, increments: &[Increment]) -> Result<FleetReport, TrialError> {
    let endpoint = free_endpoint()?;
    let zenoh_config = zenoh_config(config);
    std::fs::write(&zenoh_config, ZENOH)?;
    let mut command = Command::new(&config.executable);
    command.args(["server", "--listen", &endpoint, "--data"]).arg(&config.data).env("ZENOH_RUNTIME", SERVER_THREADS);
    command.arg("--zenoh-config").arg(&zenoh_config);
    let mut server = Process::run("the server", command)?;
    server.wait_until_listening(&endpoint, PATIENCE)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let session = runtime
        .block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], Some(zenoh_config))))?;
    let vector = upload_map(&session, &config.map, increments)?;

    let mut report = FleetReport {
        clients: config.clients,
        rate_hz: config.rate_hz,
        processors: std::thread::available_parallelism().map_or(0, usize::from),
        ..FleetReport::default()
    };
    let single = vec![clients_of(config, &endpoint, None)];
    let alone = Watch { server: server.id(), report: &mut report }.follow(single, &AtomicBool::default())?;
    let is_warm = AtomicBool::default();
    let (stop, memory) = (AtomicBool::default(), std::sync::Mutex::new(Memory::default()));
    let together = std::thread::scope(|scope| {
        scope.spawn(|| watch_memory(server.id(), &is_warm, &stop, &memory));
        let writer = scope.spawn(|| change(config, &session, vector, &stop));
        let all = parts(config.clients).map(|part| clients_of(config, &endpoint, Some(part))).collect();
        let together = Watch { server: server.id(), report: &mut report }.follow(all, &is_warm);
        stop.store(true, Ordering::Release);
        let versions = writer.join().unwrap_or(Ok(0))?;
        Ok::<_, TrialError>((together?, versions))
    });
    let (together, versions) = together?;
    let memory = memory.into_inner().unwrap_or_default();
    (report.warm_bytes, report.most_bytes, report.last_bytes) = (memory.warm, memory.most, memory.last);
    (report.path, report.bare) = (together.path, together.bare);
    (report.path_alone, report.bare_alone) = (alone.path_alone, alone.bare_alone);
    (report.copies_agree, report.versions) = (together.copies_agree, versions);
    report.load = usage::load().unwrap_or(f64::NAN);
    session.close().wait()?;
    Ok(report)
}

fn zenoh_config(config: &FleetTrialConfig) -> PathBuf {
    config.data.with_extension("json5")
}

/// A process of clients: a part of all, who ask at their rate; or a single client that asks one
/// question after the other.
fn clients_of(config: &FleetTrialConfig, endpoint: &str, part: Option<(usize, usize)>) -> Command {
    let (first, clients) = part.unwrap_or((0, 1));
    let (seconds, alone) = if part.is_some() { (config.seconds, 0) } else { (0.0, config.alone) };
    let mut command = Command::new(&config.executable);
    command.args(["clients", "--connect", endpoint, "--map", config.map.as_str()]).env("ZENOH_RUNTIME", CLIENT_THREADS);
    command.arg("--zenoh-config").arg(zenoh_config(config));
    for (name, value) in [
        ("--first", first.to_string()),
        ("--clients", clients.to_string()),
        ("--head-every", config.head_every_s.to_string()),
        ("--rate", config.rate_hz.to_string()),
        ("--seconds", seconds.to_string()),
        ("--turn", config.turn_s.to_string()),
        ("--warm-up", config.warm_up_s.to_string()),
        ("--alone", alone.to_string()),
        ("--seed", config.seed.to_string()),
    ] {
        command.args([name, &value]);
    }
    command
}

/// Changes the map until told to stop, by moving one node to and fro. Returns how many increments
/// the server has stored.
fn change(
    config: &FleetTrialConfig,
    session: &Session,
    mut vector: VersionVector,
    stop: &AtomicBool,
) -> Result<u64, TrialError> {
    if config.increments_hz <= 0.0 {
        return Ok(0);
    }
    let author = AuthorId::of_robot("fleet-writer");
    let id = NodeId { author, number: 0 };
    let hlc_us = ask_head(session, &config.map, PATIENCE)?.clock_us;
    let mut number = 0;
    while !stop.load(Ordering::Acquire) {
        number += 1;
        let pose = FixedPose::from_metres(0.001 * (number % 10) as f64, 0.0, 0.0);
        let op = if number == 1 { Op::PutNode { id, kind: NodeKind::Support, pose } } else { Op::SetPose { id, pose } };
        put_increment(session, &config.map, &Increment { author, number, hlc_us: hlc_us + number, ops: vec![op] })?;
        vector.set(author, number);
        std::thread::sleep(Duration::from_secs_f64(1.0 / config.increments_hz));
    }
    Ok(ask_head(session, &config.map, PATIENCE)?.vector.get(author))
}

#[derive(Debug, Default)]
struct Memory {
    warm: u64,
    most: u64,
    last: u64,
}

fn watch_memory(server: u32, is_warm: &AtomicBool, stop: &AtomicBool, memory: &std::sync::Mutex<Memory>) {
    while !stop.load(Ordering::Acquire) {
        if let Some(bytes) = usage::resident_bytes(server)
            && let Ok(mut memory) = memory.lock()
        {
            let most = if is_warm.load(Ordering::Acquire) { &mut memory.most } else { &mut memory.warm };
            *most = bytes.max(*most);
            memory.last = bytes;
        }
        std::thread::sleep(MEMORY_EVERY);
    }
}

/// Leads the clients through a run.
struct Watch<'a> {
    server: u32,
    report: &'a mut FleetReport,
}

impl Watch<'_> {
    /// Starts the processes one after the other, and takes them from step to step.
    fn follow(self, commands: Vec<Command>, is_warm: &AtomicBool) -> Result<Report, TrialError> {
        let begin = Instant::now();
        let mut clients = ClientProcesses::new();
        let mut step = Step::End;
        for command in commands {
            step = clients.add(command)?;
        }
        self.report.joined_s = begin.elapsed().as_secs_f64();
        while step != Step::End {
            let since = self.now(&clients);
            is_warm.fetch_or(matches!(step, Step::Turn(_)), Ordering::AcqRel);
            let next = clients.step()?;
            if let (Step::Turn(kind), Some((since, now))) = (step, since.zip(self.now(&clients))) {
                let computed = match kind {
                    Kind::Path => &mut self.report.path_computed,
                    Kind::Bare => &mut self.report.bare_computed,
                };
                computed.wall_s += (now.0 - since.0).as_secs_f64();
                computed.server_s += now.1.saturating_sub(since.1).as_secs_f64();
                computed.clients_s += now.2.saturating_sub(since.2).as_secs_f64();
            }
            step = next;
        }
        clients.finish()
    }

    /// The time, and the processor times of server and clients.
    fn now(&self, clients: &ClientProcesses) -> Option<(Instant, Duration, Duration)> {
        let of_clients = clients.ids().map(usage::computed).sum::<Option<Duration>>()?;
        Some((Instant::now(), usage::computed(self.server)?, of_clients))
    }
}
