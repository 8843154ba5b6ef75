//! A site of several routers with replicated storages and several stateless servers, all of them processes, of which one each is killed
//! again and again while robots write and ask.
//!
//! What a run must show: nothing that was acknowledged is lost, and questions are answered in time throughout.

mod load;
mod machines;

use crate::process::ProcessError;
use fht_link::{LinkConfig, LinkError};
use fht_map::MapState;
use fht_proto::keys::{Key, Topic};
use fht_proto::query::Head;
use fht_proto::{AuthorId, MapName};
use load::{Asked, Reader, Writer, Written};
use machines::Machines;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::{Session, Wait};

/// How a run goes.
#[derive(Clone, Debug)]
pub struct SiteConfig {
    /// The handoff binary.
    pub executable: PathBuf,
    /// Where configurations go.
    pub folder: PathBuf,
    /// Routers, each with a storage. Default 3.
    pub routers: usize,
    /// Stateless servers. Default 3.
    pub servers: usize,
    /// Robots that write. Default 3.
    pub writers: usize,
    /// Increments that each of them writes, a second. Default 10.
    pub increments_per_s: f64,
    /// Robots that ask. Default 4.
    pub readers: usize,
    /// Questions that each of them asks, a second. Default 10.
    pub questions_per_s: f64,
    /// How long there is load. Default 5 minutes.
    pub duration: Duration,
    /// One router and one server are killed every so often. Default 20 s.
    pub kill_every: Duration,
    /// … and come back after this time. Default 5 s.
    pub back_after: Duration,
    /// Decides who is killed.
    pub seed: u64,
    /// How long an answer may take, for the one who asks. Default 2 s.
    pub limit: Duration,
    /// How long the last acknowledgement, and agreement, may take in the end. Default 60 s.
    pub patience: Duration,
}

impl SiteConfig {
    /// Defaults, for programs of `executable` with what they need in `folder`.
    #[must_use]
    pub fn new(executable: PathBuf, folder: PathBuf) -> Self {
        Self {
            executable,
            folder,
            routers: 3,
            servers: 3,
            writers: 3,
            increments_per_s: 10.0,
            readers: 4,
            questions_per_s: 10.0,
            duration: Duration::from_secs(300),
            kill_every: Duration::from_secs(20),
            back_after: Duration::from_secs(5),
            seed: 1,
            limit: Duration::from_secs(2),
            patience: Duration::from_secs(60),
        }
    }
}

/// What a run has shown.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SiteReport {
    /// Increments written.
    pub written: u64,
    /// … and acknowledged.
    pub acknowledged: u64,
    /// Acknowledged increments that a server, or the storages, did not have in the end.
    pub lost: u64,
    /// Whether all servers had one map in the end, and it was what the writers wrote.
    pub agree: bool,
    /// The same of servers that began anew then and had it all from the storages.
    pub agree_anew: bool,
    /// Routers and servers killed.
    pub kills: u64,
    /// Questions asked.
    pub questions: u64,
    /// Those that were not answered within the limit.
    pub late: u64,
    /// Times that a question was put again.
    pub repeated: u64,
    /// Median of the time to an answer, milliseconds.
    pub median_ms: f64,
    /// 99 of 100 took less, milliseconds.
    pub p99_ms: f64,
    /// The greatest, milliseconds.
    pub greatest_ms: f64,
    /// Longest time between an increment's being written and acknowledged, milliseconds.
    pub greatest_acknowledgement_ms: f64,
    /// Bytes put by writers over bytes of their increments.
    pub repetition: f64,
}

impl SiteReport {
    /// Whether all is as it must be.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.lost == 0 && self.late == 0 && self.agree && self.agree_anew && self.acknowledged == self.written
    }
}

/// Why a run came to no result.
#[derive(Debug, thiserror::Error)]
pub enum SiteError {
    /// A process failed.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A session cannot be opened.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Zenoh refused.
    #[error("Zenoh refuses: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// A file or a port.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Publishing ended with an error.
    #[error("a writer failed: {0}")]
    Publish(#[from] mapper::publish::PublishError),
    /// A robot's thread panicked.
    #[error("a robot's thread failed: {0}")]
    Thread(#[from] tokio::task::JoinError),
    /// The site does not come up.
    #[error("{0}")]
    Late(String),
}

/// The map of the run.
fn map() -> MapName {
    // A constant that is a name.
    "site".parse().unwrap_or_else(|error| panic!("{error}"))
}

/// `endpoints`, beginning with the one at `first`.
fn rotated(endpoints: &[String], first: usize) -> Vec<String> {
    let first = first % endpoints.len().max(1);
    endpoints[first..].iter().chain(&endpoints[..first]).cloned().collect()
}

/// Opens a robot's session; its first router is the one at `first`.
async fn session(endpoints: &[String], first: usize) -> Result<Session, SiteError> {
    Ok(fht_link::open(&LinkConfig::from_options(rotated(endpoints, first), None)).await?)
}

/// Runs a site. `say` is told what happens.
///
/// # Errors
/// [`SiteError`]: there is no result.
pub fn run(config: &SiteConfig, say: impl Fn(&str)) -> Result<SiteReport, SiteError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let outcome = runtime.block_on(run_within(config, &say));
    runtime.shutdown_timeout(Duration::from_secs(5));
    outcome
}

async fn run_within(config: &SiteConfig, say: &impl Fn(&str)) -> Result<SiteReport, SiteError> {
    let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
    let mut machines = Machines::start(config)?;
    let endpoints = machines.endpoints().to_vec();
    let watcher = session(&endpoints, 0).await?;
    until_all_answer(&watcher, config).await?;
    say("all servers are there");

    let written = Arc::new(Written::default());
    load::write_basis(&session(&endpoints, 0).await?, &written, config.patience).await?;
    let is_over = Arc::new(AtomicBool::new(false));
    let mut writers = Vec::new();
    for index in 0..config.writers {
        let link = session(&endpoints, index).await?;
        let writer = Writer::new(index, config.increments_per_s, Arc::clone(&written));
        writers.push(tokio::spawn(writer.run(link, Arc::clone(&is_over), config.patience)));
    }
    let mut readers = Vec::new();
    for index in 0..config.readers {
        let link = session(&endpoints, index).await?;
        let reader = Reader::new(index, config.questions_per_s, config.limit);
        let is_over = Arc::clone(&is_over);
        readers.push(tokio::task::spawn_blocking(move || reader.run(&link, &is_over)));
    }

    let begin = Instant::now();
    let until = |time: Duration| tokio::time::sleep_until((begin + time).into());
    let mut kills = 0;
    let times = (1..).map(|round: u32| config.kill_every * round).take_while(|back| *back <= config.duration);
    for back in times {
        until(back.saturating_sub(config.back_after)).await;
        let (router, server) = (rng.random_range(0..config.routers), rng.random_range(0..config.servers));
        machines.kill(router, server)?;
        kills += 2;
        say(&format!("{:4.0} s: router {router} and server {server} are killed", begin.elapsed().as_secs_f64()));
        until(back).await;
        machines.start_again(router, server)?;
    }
    until(config.duration).await;
    is_over.store(true, Ordering::Relaxed);

    let mut report = SiteReport { kills, ..SiteReport::default() };
    let mut asked = Asked::default();
    for reader in readers {
        asked.add(reader.await?);
    }
    asked.tell(&mut report);
    let (mut wire_bytes, mut map_bytes) = (0, 0);
    for writer in writers {
        let progress = writer.await??;
        wire_bytes += progress.wire_bytes;
        map_bytes += progress.map_bytes;
    }
    report.repetition = wire_bytes as f64 / (map_bytes as f64).max(1.0);
    written.tell(&mut report);

    let expected = written.state();
    let acknowledged = written.acknowledged();
    (report.agree, report.lost) = agreement(&watcher, config, &expected, &acknowledged).await?;
    say("now all servers begin anew");
    machines.begin_anew()?;
    let (agree, lost) = agreement(&watcher, config, &expected, &acknowledged).await?;
    (report.agree_anew, report.lost) = (agree, report.lost.max(lost));
    Ok(report)
}

/// Whether all servers agree with what was written, as soon as they do; and how much of what was acknowledged one of them lacks.
async fn agreement(
    watcher: &Session,
    config: &SiteConfig,
    expected: &MapState,
    acknowledged: &BTreeMap<AuthorId, u64>,
) -> Result<(bool, u64), SiteError> {
    let digest = expected.digest();
    let is_same = |head: &Head| head.digest == digest;
    let (heads, agree) = match all_heads(watcher, config.servers, config.patience, is_same).await {
        Ok(heads) => (heads, true),
        Err(SiteError::Late(_)) => (heads_of(watcher).await?, false),
        Err(other) => return Err(other),
    };
    let lacks = |head: &Head| {
        acknowledged.iter().map(|(&author, &count)| count.saturating_sub(head.vector.get(author))).sum::<u64>()
    };
    Ok((agree, heads.iter().map(lacks).max().unwrap_or(u64::MAX)))
}

/// What all servers answer now.
async fn answers_of_all(session: &Session, key: &Key) -> Result<Vec<Vec<u8>>, SiteError> {
    let replies = session
        .get(key.to_string())
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(Duration::from_secs(2))
        .await?;
    let mut answers = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        answers.extend(reply.result().ok().map(|sample| sample.payload().to_bytes().into_owned()));
    }
    Ok(answers)
}

async fn heads_of(session: &Session) -> Result<Vec<Head>, SiteError> {
    let answers = answers_of_all(session, &Key::topic(&map(), Topic::Head)).await?;
    Ok(answers.iter().filter_map(|answer| serde_json::from_slice(answer).ok()).collect())
}

/// Waits until all servers answer.
async fn until_all_answer(session: &Session, config: &SiteConfig) -> Result<(), SiteError> {
    let begin = Instant::now();
    while answers_of_all(session, &Key::Maps).await?.len() < config.servers {
        if begin.elapsed() > config.patience {
            return Err(SiteError::Late("not all servers answer".to_owned()));
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    Ok(())
}

/// Waits until `count` servers answer, each with a head that is `good`.
async fn all_heads(
    session: &Session,
    count: usize,
    patience: Duration,
    good: impl Fn(&Head) -> bool,
) -> Result<Vec<Head>, SiteError> {
    let begin = Instant::now();
    loop {
        let heads = heads_of(session).await?;
        if heads.len() == count && heads.iter().all(&good) {
            return Ok(heads);
        }
        if begin.elapsed() > patience {
            let seen: Vec<String> = heads.iter().map(|head| head.vector.to_string()).collect();
            return Err(SiteError::Late(format!("of {count} servers these answer as they should: {seen:?}")));
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
}

/// Closes a session; nobody is left to be told otherwise.
fn close(session: &Session) {
    let _ = session.close().wait();
}
