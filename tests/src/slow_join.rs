//! A client joins a map over a thin link that breaks, while others write: how long it takes, how
//! many bytes are sent twice, and how late live increments are.

use crate::thin_link::{LinkShape, ThinLink};
use crate::trial::TrialError;
use crate::upload::{put_increment, upload_map};
use fht_client::{LiveReplica, ReplicaConfig, ask_head};
use fht_demo::{Process, free_endpoint};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector};
use fht_session::SessionConfig;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

/// How long the server may take to start and to store the map, and a client to join.
const PATIENCE: Duration = Duration::from_secs(180);

/// How a run goes.
#[derive(Clone, Debug)]
pub struct SlowJoinConfig {
    /// A program with the role `map-server` (`handoff`).
    pub executable: PathBuf,
    /// The server's data directory.
    pub data: PathBuf,
    /// The link.
    pub shape: LinkShape,
    /// How often the link is cut, evenly over the bytes of the map.
    pub cuts: u64,
    /// How long each cut lasts.
    pub cut_for: Duration,
    /// Time between live increments.
    pub every: Duration,
    /// How long the client listens after it has the map.
    pub after: Duration,
}

/// How one client joined.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SlowJoin {
    /// Time from the start until it had everything that existed at the start, seconds.
    pub seconds: f64,
    /// Bytes of answers that brought increments.
    pub fetched_bytes: u64,
    /// All bytes that came down the link meanwhile.
    pub link_bytes: u64,
    /// How often the link was cut.
    pub cuts: usize,
    /// How late live increments were, seconds, sorted. For an increment put while the link was
    /// down, time counts from when it was up again.
    pub live_s: Vec<f64>,
}

/// The results.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SlowJoinReport {
    /// Bytes of the map, as the server counts them.
    pub map_bytes: u64,
    /// Over a link that holds.
    pub whole: SlowJoin,
    /// Over a link that is cut.
    pub cut: SlowJoin,
}

impl SlowJoinReport {
    /// Bytes that were fetched again, as a share of those fetched over a link that holds.
    #[must_use]
    pub fn refetched(&self) -> f64 {
        self.cut.fetched_bytes as f64 / self.whole.fetched_bytes.max(1) as f64 - 1.0
    }

    /// The same for all bytes on the link: it includes the handshakes of new connections, and what
    /// was lost under way.
    #[must_use]
    pub fn sent_again(&self) -> f64 {
        self.cut.link_bytes as f64 / self.whole.link_bytes.max(1) as f64 - 1.0
    }
}

/// A map-server with a map on it.
pub struct MapSite {
    _server: Process,
    _runtime: tokio::runtime::Runtime,
    /// Where the server listens.
    pub endpoint: String,
    /// The writer's session.
    pub session: Session,
    /// The map.
    pub map: MapName,
    /// What the server has.
    pub vector: VersionVector,
}

impl MapSite {
    /// Starts a server and uploads the map that `increments` make.
    ///
    /// # Errors
    /// [`TrialError`].
    pub fn with(config: &SlowJoinConfig, map: &MapName, increments: &[Increment]) -> Result<Self, TrialError> {
        let endpoint = free_endpoint()?;
        let server = Process::map_server(&config.executable, &config.data, &endpoint, PATIENCE)?;
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        let session =
            runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None)))?;
        let vector = upload_map(&session, map, increments)?;
        Ok(Self { _server: server, _runtime: runtime, endpoint, session, map: map.clone(), vector })
    }

    /// Opens another session through `endpoint`.
    ///
    /// # Errors
    /// [`TrialError::Link`].
    pub fn session_by(&self, endpoint: &str) -> Result<Session, TrialError> {
        let link = SessionConfig::from_options(vec![endpoint.to_owned()], None);
        Ok(self._runtime.block_on(fht_session::open(&link))?)
    }
}

/// Runs it over a link that holds and over one that is cut.
///
/// # Errors
/// [`TrialError`].
pub fn run(config: &SlowJoinConfig, map: &MapName, increments: &[Increment]) -> Result<SlowJoinReport, TrialError> {
    let site = MapSite::with(config, map, increments)?;
    let map_bytes = ask_head(&site.session, map, PATIENCE)?.bytes;
    let whole = join(config, &site, "whole", &[])?;
    let step = whole.fetched_bytes / (config.cuts + 1);
    let cuts: Vec<u64> = (1..=config.cuts).map(|cut| cut * step).collect();
    let cut = join(config, &site, "cut", &cuts)?;
    site.session.close().wait()?;
    Ok(SlowJoinReport { map_bytes, whole, cut })
}

/// One client joins over a link that is cut at these byte counts, while the author `writer` writes.
fn join(config: &SlowJoinConfig, site: &MapSite, writer: &str, cut_at: &[u64]) -> Result<SlowJoin, TrialError> {
    let link = ThinLink::to(&site.endpoint, config.shape)?;
    link.cut_at(cut_at.to_vec(), config.cut_for);
    let author = AuthorId::of_robot(writer);
    let (stop, put_at) = (AtomicBool::default(), Mutex::new(Vec::new()));
    let (joining, arrived) = std::thread::scope(|scope| {
        let writing = scope.spawn(|| write_live(config, site, author, &stop, &put_at));
        let joined = listen(config, site, &link, author);
        stop.store(true, Ordering::Release);
        writing.join().unwrap_or(Err(TrialError::Late("the writer ended")))?;
        joined
    })?;
    let put_at = put_at.into_inner().unwrap_or_default();
    let breaks = link.breaks();
    // For an increment put while the link was down, time counts from when it was up again.
    let from = |at: Instant| {
        let during = breaks.iter().find(|(begin, end)| *begin <= at && end.is_none_or(|end| at < end));
        during.map_or(Some(at), |(_, end)| *end)
    };
    // An increment that was under way when the link broke arrived with those put afterwards.
    let was_cut = |at: Instant, came: Instant| breaks.iter().any(|(begin, _)| at <= *begin && *begin <= came);
    let mut live_s: Vec<f64> = put_at
        .iter()
        .zip(&arrived)
        .filter_map(|(&at, &came)| Some((came, from(at)?)))
        .filter(|&(came, from)| !was_cut(from, came))
        .map(|(came, from)| came.saturating_duration_since(from).as_secs_f64())
        .collect();
    live_s.sort_by(f64::total_cmp);
    Ok(SlowJoin { cuts: breaks.len(), live_s, ..joining })
}

/// Writes small increments until told to stop.
fn write_live(
    config: &SlowJoinConfig,
    site: &MapSite,
    author: AuthorId,
    stop: &AtomicBool,
    put_at: &Mutex<Vec<Instant>>,
) -> Result<(), TrialError> {
    let hlc_us = ask_head(&site.session, &site.map, PATIENCE)?.clock_us;
    for number in 1.. {
        if stop.load(Ordering::Acquire) {
            break;
        }
        let id = NodeId { author, number: 0 };
        let pose = FixedPose::from_metres(0.01 * number as f64, 0.0, 0.0);
        let op = Op::PutNode { id, kind: NodeKind::Support, pose };
        if let Ok(mut put_at) = put_at.lock() {
            put_at.push(Instant::now());
        }
        put_increment(&site.session, &site.map, &Increment { author, number, hlc_us: hlc_us + number, ops: vec![op] })?;
        std::thread::sleep(config.every);
    }
    Ok(())
}

/// The client. Also returns when each of the writer's increments was in its copy: it listens until
/// it has all that there were when its time was up, so that late ones count as well.
fn listen(
    config: &SlowJoinConfig,
    site: &MapSite,
    link: &ThinLink,
    author: AuthorId,
) -> Result<(SlowJoin, Vec<Instant>), TrialError> {
    let begin = Instant::now();
    let session = site.session_by(link.endpoint())?;
    let replica = LiveReplica::start(&session, &site.map, "joining", ReplicaConfig::default())?;
    let (mut arrived, mut joining) = (Vec::new(), None);
    let mut look = |all: &VersionVector| {
        std::thread::sleep(Duration::from_millis(1));
        let (count, is_there) = {
            let copy = replica.read();
            (copy.vector().get(author) as usize, copy.vector().covers(all))
        };
        let now = Instant::now();
        arrived.resize(arrived.len().max(count), now);
        (now, is_there)
    };
    let mut until = begin + PATIENCE;
    while Instant::now() < until {
        let (now, is_whole) = look(&site.vector);
        if is_whole && joining.is_none() {
            joining = Some(SlowJoin {
                seconds: begin.elapsed().as_secs_f64(),
                fetched_bytes: replica.fetched_bytes(),
                link_bytes: link.bytes_down(),
                ..SlowJoin::default()
            });
            until = now + config.after;
        }
    }
    let joining = joining.ok_or(TrialError::Late("the client did not get the map"))?;
    let head = ask_head(&site.session, &site.map, PATIENCE)?;
    until = Instant::now() + Duration::from_secs(20);
    while !look(&head.vector).1 {
        if Instant::now() > until {
            return Err(TrialError::Late("the client did not catch up with what is live"));
        }
    }
    drop(replica);
    session.close().wait()?;
    Ok((joining, arrived))
}
