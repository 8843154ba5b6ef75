//! A client joins a map over a thin link that breaks, while others write: how long it takes, how many bytes come twice, and how late
//! live increments are.

use crate::feed::{FeedError, put, write};
use crate::process::{Process, ProcessError, free_endpoint};
use crate::thin_link::{LinkShape, ThinLink};
use client_robot::replica::{AskError, LiveReplica, ReplicaConfig, ReplicaError, ask_head};
use fht_link::{LinkConfig, LinkError};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector};
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

/// How long the server may take to start and to take the map in, and a client to join.
const PATIENCE: Duration = Duration::from_secs(180);

/// What is tried.
#[derive(Clone, Debug)]
pub struct JoiningConfig {
    /// A program with the role of the map-server (`handoff`).
    pub executable: PathBuf,
    /// Where the server keeps its map.
    pub data: PathBuf,
    /// The link.
    pub shape: LinkShape,
    /// The link is cut so many times, evenly over the bytes of the map.
    pub cuts: u64,
    /// How long each time.
    pub cut_for: Duration,
    /// Between live increments.
    pub every: Duration,
    /// The client still listens for so long when it has the map.
    pub after: Duration,
}

/// One client's joining.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Joining {
    /// From the start until it had everything that there was at the start, seconds.
    pub seconds: f64,
    /// Bytes of answers that brought increments.
    pub fetched_bytes: u64,
    /// Bytes that came down the link meanwhile, of everything.
    pub link_bytes: u64,
    /// How often the link was cut.
    pub cuts: usize,
    /// How late live increments were that were put, or could come again, while the link was there: seconds from then on, sorted.
    pub live_s: Vec<f64>,
}

/// What came out.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JoiningReport {
    /// Bytes of the map, as the server counts them.
    pub map_bytes: u64,
    /// Over a link that holds.
    pub whole: Joining,
    /// Over one that is cut.
    pub cut: Joining,
}

impl JoiningReport {
    /// Bytes that were fetched again, as a share of those fetched over a link that holds.
    #[must_use]
    pub fn refetched(&self) -> f64 {
        self.cut.fetched_bytes as f64 / self.whole.fetched_bytes.max(1) as f64 - 1.0
    }

    /// The same of all bytes on the link: with the greetings of new connections, and what was lost under way.
    #[must_use]
    pub fn sent_again(&self) -> f64 {
        self.cut.link_bytes as f64 / self.whole.link_bytes.max(1) as f64 - 1.0
    }
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum JoiningError {
    /// The server is of no use.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// The system refuses.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// No session.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// No copy.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The server does not answer.
    #[error(transparent)]
    Ask(#[from] AskError),
    /// Zenoh refuses.
    #[error("Zenoh refuses: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// The map is not on the server.
    #[error(transparent)]
    Feed(#[from] FeedError),
    /// Something did not come in time.
    #[error("{0} in time")]
    Late(&'static str),
}

/// A map-server with a map on it.
pub struct Site {
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

impl Site {
    /// Starts a server and gives it the map that `increments` make.
    ///
    /// # Errors
    /// [`JoiningError`].
    pub fn with(config: &JoiningConfig, map: &MapName, increments: &[Increment]) -> Result<Self, JoiningError> {
        let endpoint = free_endpoint()?;
        let server = Process::map_server(&config.executable, &config.data, &endpoint, PATIENCE)?;
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        let session = runtime.block_on(fht_link::open(&LinkConfig::from_options(vec![endpoint.clone()], None)))?;
        let vector = write(&session, map, increments)?;
        Ok(Self { _server: server, _runtime: runtime, endpoint, session, map: map.clone(), vector })
    }

    /// Opens another session, by way of `endpoint`.
    ///
    /// # Errors
    /// [`JoiningError::Link`].
    pub fn session_by(&self, endpoint: &str) -> Result<Session, JoiningError> {
        let link = LinkConfig::from_options(vec![endpoint.to_owned()], None);
        Ok(self._runtime.block_on(fht_link::open(&link))?)
    }
}

/// Tries it over a link that holds and over one that is cut.
///
/// # Errors
/// [`JoiningError`].
pub fn run(config: &JoiningConfig, map: &MapName, increments: &[Increment]) -> Result<JoiningReport, JoiningError> {
    let site = Site::with(config, map, increments)?;
    let map_bytes = ask_head(&site.session, map, PATIENCE)?.bytes;
    let whole = join(config, &site, "whole", &[])?;
    let step = whole.fetched_bytes / (config.cuts + 1);
    let cuts: Vec<u64> = (1..=config.cuts).map(|cut| cut * step).collect();
    let cut = join(config, &site, "cut", &cuts)?;
    site.session.close().wait()?;
    Ok(JoiningReport { map_bytes, whole, cut })
}

/// One client joins over a link that is cut at these numbers of bytes, while a writer of this name writes.
fn join(config: &JoiningConfig, site: &Site, writer: &str, cut_at: &[u64]) -> Result<Joining, JoiningError> {
    let link = ThinLink::to(&site.endpoint, config.shape)?;
    link.cut_at(cut_at.to_vec(), config.cut_for);
    let author = AuthorId::of_robot(writer);
    let (stop, put_at) = (AtomicBool::default(), Mutex::new(Vec::new()));
    let (joining, arrived) = std::thread::scope(|scope| {
        let writing = scope.spawn(|| write_live(config, site, author, &stop, &put_at));
        let joined = listen(config, site, &link, author);
        stop.store(true, Ordering::Release);
        writing.join().unwrap_or(Err(JoiningError::Late("the writer ended")))?;
        joined
    })?;
    let put_at = put_at.into_inner().unwrap_or_default();
    let breaks = link.breaks();
    // Of an increment that was put while the link was not there, the time counts from when somebody could use it again.
    let from = |at: Instant| {
        let during = breaks.iter().find(|(begin, end)| *begin <= at && end.is_none_or(|end| at < end));
        during.map_or(Some(at), |(_, end)| *end)
    };
    // One that was under way when the link broke came with those that were put afterwards.
    let was_cut = |at: Instant, came: Instant| breaks.iter().any(|(begin, _)| at <= *begin && *begin <= came);
    let mut live_s: Vec<f64> = put_at
        .iter()
        .zip(&arrived)
        .filter_map(|(&at, &came)| Some((came, from(at)?)))
        .filter(|&(came, from)| !was_cut(from, came))
        .map(|(came, from)| came.saturating_duration_since(from).as_secs_f64())
        .collect();
    live_s.sort_by(f64::total_cmp);
    Ok(Joining { cuts: breaks.len(), live_s, ..joining })
}

/// Writes a small increment at a time, until told to stop.
fn write_live(
    config: &JoiningConfig,
    site: &Site,
    author: AuthorId,
    stop: &AtomicBool,
    put_at: &Mutex<Vec<Instant>>,
) -> Result<(), JoiningError> {
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
        put(&site.session, &site.map, &Increment { author, number, hlc_us: hlc_us + number, ops: vec![op] })?;
        std::thread::sleep(config.every);
    }
    Ok(())
}

/// The client. Returns also when each of the writer's increments was in its copy.
fn listen(
    config: &JoiningConfig,
    site: &Site,
    link: &ThinLink,
    author: AuthorId,
) -> Result<(Joining, Vec<Instant>), JoiningError> {
    let begin = Instant::now();
    let session = site.session_by(link.endpoint())?;
    let replica = LiveReplica::start(&session, &site.map, "joining", ReplicaConfig::default())?;
    let (mut arrived, mut joining) = (Vec::new(), None);
    let mut until = begin + PATIENCE;
    while Instant::now() < until {
        std::thread::sleep(Duration::from_millis(1));
        let (count, is_whole) = {
            let copy = replica.read();
            (copy.vector().get(author) as usize, copy.vector().covers(&site.vector))
        };
        let now = Instant::now();
        arrived.resize(arrived.len().max(count), now);
        if is_whole && joining.is_none() {
            joining = Some(Joining {
                seconds: begin.elapsed().as_secs_f64(),
                fetched_bytes: replica.fetched_bytes(),
                link_bytes: link.bytes_down(),
                ..Joining::default()
            });
            until = now + config.after;
        }
    }
    let joining = joining.ok_or(JoiningError::Late("the client did not get the map"))?;
    let head = ask_head(&site.session, &site.map, PATIENCE)?;
    if !replica.wait_for(&head.vector, Duration::from_secs(20)) {
        return Err(JoiningError::Late("the client did not catch up with what is live"));
    }
    drop(replica);
    session.close().wait()?;
    Ok((joining, arrived))
}

/// A map as long as an explored office: 138 main nodes of usual size in a hall of 716 nodes; or so many times that.
#[must_use]
pub fn office(times: u32) -> Vec<Increment> {
    use fht_proto::{Descriptor, EdgeKey, ModelId, Rect, ScanRecord, Signature};
    const COLUMNS: u32 = 28;
    let author = AuthorId::of_robot("surveyor");
    let node = |number: u32| NodeId { author, number };
    let increment = |(index, number): (u32, u64)| {
        let (x, y) = (f64::from(index % COLUMNS) * 2.0, f64::from(index / COLUMNS) * 2.0);
        let pose = FixedPose::from_metres(x, y, 0.0);
        let is_main = index.is_multiple_of(5);
        let rect = Rect::around(pose.position, (x - 1.1, y - 1.1), (x + 1.1, y + 1.1));
        let kind = if is_main { NodeKind::Main } else { NodeKind::Support };
        let mut ops =
            vec![Op::PutNode { id: node(index), kind, pose }, Op::SetFreeSpace { id: node(index), rect: Some(rect) }];
        if is_main {
            let components: Vec<f32> = (0..256).map(|i| ((i * (index + 1)) as f32 * 0.37).sin()).collect();
            // Walls at some distance, as rough as measured ones.
            let range = |beam: u32| {
                let wall_mm = 4000.0 / f64::from(beam).mul_add(0.0175, 0.3).cos().abs().max(0.4);
                (wall_mm as u32 + (beam * 7 + index * 13) % 20) as u16 / 5 * 5
            };
            let scan = ScanRecord {
                base_from_sensor: FixedPose::default(),
                angle_min: 0.0,
                angle_increment: 0.0175,
                ranges_mm: (0..360).map(range).collect(),
            };
            let descriptor = Some(Descriptor::quantise(ModelId(1), &components));
            ops.push(Op::SetSignature { id: node(index), signature: Signature { descriptor, scan } });
        }
        let before = [(!index.is_multiple_of(COLUMNS)).then(|| index - 1), index.checked_sub(COLUMNS)];
        let edges = before.into_iter().flatten();
        ops.extend(edges.map(|other| Op::PutEdge { edge: EdgeKey::new(node(other), node(index)) }));
        Increment { author, number, hlc_us: number, ops }
    };
    (0..716 * times).zip(1..).map(increment).collect()
}
