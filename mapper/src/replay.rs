//! Mapping from a bag: the frames come from a recorded run, and somebody else has driven.

use crate::camera::CameraError;
use crate::fellows::Entry;
use crate::linked::{Handover, Linked, LinkedError, Publication, wait_for};
use crate::mapping::{Mapper, MapperConfig};
use crate::publish::Outbox;
use crate::record::MapRecorder;
use fht_link::LinkConfig;
use fht_proto::{AuthorId, Digest, MapName};
use fht_robot::bag::{BagReport, FrameConfig, FrameError, Frames, WriteError};
use fht_robot::descriptor::{DescriptorError, DescriptorNet};
use fht_robot::stop::Stop;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What to replay and where to publish.
#[derive(Clone, Debug)]
pub struct ReplayTask {
    /// The bag: an MCAP file or a folder.
    pub bag: PathBuf,
    /// How it becomes frames.
    pub frames: FrameConfig,
    /// Name of the map to write.
    pub map: MapName,
    /// Name of the robot; its author id follows from it.
    pub robot: String,
    /// The server; `None` maps without publishing.
    pub link: Option<LinkConfig>,
    /// Another descriptor model than the built-in one.
    pub model: Option<PathBuf>,
    /// Recorded seconds per second; `None` is as fast as possible.
    pub rate: Option<f64>,
    /// How long to wait for the server's last acknowledgement, seconds.
    pub linger_s: f64,
    /// Algorithm parameters.
    pub mapper: MapperConfig,
    /// A bag to write, with the map in it.
    pub record: Option<PathBuf>,
    /// Ends the replay early, with the map finished as it is.
    pub stop: Stop,
}

/// Why a replay failed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The bag does not become frames.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// No frame came of it.
    #[error("the bag gave no frame to map from\n{0}")]
    NoFrames(Box<BagReport>),
    /// The descriptor network cannot be loaded.
    #[error("{0}; --no-cameras maps without appearance")]
    Descriptor(#[from] DescriptorError),
    /// The map cannot be published.
    #[error(transparent)]
    Linked(#[from] LinkedError),
    /// The recording failed.
    #[error("the recording failed: {0}")]
    Record(#[from] WriteError),
    /// The cameras failed on the way.
    #[error(transparent)]
    Cameras(#[from] CameraError),
    /// The system gave no thread.
    #[error("a thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The loop ended early: a defect.
    #[error("the mapping loop failed: {0}")]
    Loop(#[from] tokio::task::JoinError),
}

/// What happens while it runs, for progress displays.
#[derive(Clone, Debug)]
pub struct ReplaySnapshot {
    /// Bytes of the bag read.
    pub read_bytes: u64,
    /// Bytes of the bag.
    pub total_bytes: u64,
    /// Seconds of the bag so far.
    pub bag_s: f64,
    /// Frames so far.
    pub frames: usize,
    /// Nodes of the map.
    pub nodes: usize,
    /// Increments written.
    pub written: u64,
    /// Increments that the server has durably.
    pub acknowledged: u64,
}

/// Figures of a replay.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReplayReport {
    /// What became of the bag's messages.
    pub bag: BagReport,
    /// Whether nodes carry descriptors: the bag has four cameras.
    pub has_cameras: bool,
    /// Main nodes of the map.
    pub main_nodes: usize,
    /// Support nodes of the map.
    pub support_nodes: usize,
    /// Edges of the map.
    pub edges: usize,
    /// Free area on the grid, square metres.
    pub free_area_m2: f64,
    /// Increments written.
    pub version: u64,
    /// Digest of the map.
    pub digest: Digest,
    /// Bytes of all increments, each counted once.
    pub map_bytes: u64,
    /// Bytes put on the wire, repetitions included.
    pub wire_bytes: u64,
    /// Whether the server has acknowledged everything.
    pub delivered: bool,
    /// Frames that nothing could be made of.
    pub frames_refused: usize,
    /// Loop closures: close at hand, and after a long way.
    pub closures: [usize; 2],
    /// Distance driven by the wheels' word, metres.
    pub driven_m: f64,
    /// Time from the first frame to the last, seconds.
    pub bag_s: f64,
    /// Longest time that a frame took, reading excluded, milliseconds.
    pub frame_max_ms: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
}

/// Maps from a bag and publishes. `watch` is called about once a recorded second from the loop's thread.
///
/// # Errors
/// [`ReplayError`]; a replay that ended is reported even if the server could not be reached (`delivered` false).
pub async fn replay(
    task: ReplayTask,
    watch: impl FnMut(ReplaySnapshot) + Send + 'static,
) -> Result<ReplayReport, ReplayError> {
    let frames = Frames::open(&task.bag, task.frames.clone())?;
    let net = if frames.has_cameras() { Some(DescriptorNet::load(task.model.as_deref())?) } else { None };
    let mapper = Mapper::new(task.mapper.clone(), AuthorId::of_robot(&task.robot), net)?;
    let recorder = task.record.as_deref().map(MapRecorder::start).transpose()?;
    // What is no duration is for ever.
    let linger = Duration::try_from_secs_f64(task.linger_s.max(0.0)).unwrap_or(Duration::MAX);

    let Some(link) = task.link.clone() else {
        let run = tokio::task::spawn_blocking(move || feed(&task, frames, mapper, recorder, None, watch));
        return run.await?;
    };
    // A bag can be replayed: nothing need survive.
    let (map, robot) = (task.map.clone(), task.robot.clone());
    let publication = Publication { link, map, robot, spool: None, linger };
    let run = move |outbox: &Outbox| feed(&task, frames, mapper, recorder, Some(outbox), watch);
    let linked = Linked::open(publication).await?;
    linked.require_new()?;
    let (report, published) = linked.publish_while(Entry::Found { stored: 0 }, run).await?;
    let mut report = report?;
    report.map_bytes = published.map_bytes;
    report.wire_bytes = published.wire_bytes;
    report.delivered = published.acknowledged >= report.version;
    Ok(report)
}

/// The loop: read, think.
fn feed(
    task: &ReplayTask,
    mut frames: Frames,
    mut mapper: Mapper,
    mut recorder: Option<MapRecorder>,
    outbox: Option<&Outbox>,
    mut watch: impl FnMut(ReplaySnapshot),
) -> Result<ReplayReport, ReplayError> {
    let begin = Instant::now();
    let mut frame_max = Duration::ZERO;
    let (mut frames_taken, mut frames_refused) = (0, 0);
    let mut driven_m = 0.0;
    let mut last_odom: Option<nalgebra::Vector2<f64>> = None;
    let (mut first_us, mut last_us, mut next_watch_us) = (None, 0, 0);
    let mut handover = Handover::new(outbox);
    while let Some(frame) = frames.next().transpose()? {
        let bag_us = frame.time_us - *first_us.get_or_insert(frame.time_us);
        wait_for(begin, bag_us, task.rate);
        let thinking = Instant::now();
        if let Err(error) = mapper.observe(&frame) {
            tracing::warn!("a frame is left out: {error}");
            frames_refused += 1;
            continue;
        }
        frames_taken += 1;
        let odom_from_base = frame.odom_from_base.translation.vector;
        driven_m += last_odom.map_or(0.0, |last| (odom_from_base - last).norm());
        last_odom = Some(odom_from_base);
        mapper.check()?;
        let written = handover.take_from(&mut mapper);
        frame_max = frame_max.max(thinking.elapsed());
        if let Some(recorder) = &mut recorder {
            recorder.record(&frame, &mapper);
        }
        last_us = bag_us;
        if bag_us >= next_watch_us {
            next_watch_us = bag_us + 1_000_000;
            let counts = mapper.map().counts();
            let (read_bytes, total_bytes) = frames.progress();
            watch(ReplaySnapshot {
                read_bytes,
                total_bytes,
                bag_s: bag_us as f64 * 1e-6,
                frames: frames_taken,
                nodes: counts.main_nodes + counts.support_nodes,
                written,
                acknowledged: handover.acknowledged(),
            });
        }
        if task.stop.is_set() || handover.has_ended() {
            break;
        }
    }
    if first_us.is_none() {
        return Err(ReplayError::NoFrames(Box::new(frames.report())));
    }
    mapper.finish();
    let version = handover.take_from(&mut mapper);
    if let Some(recorder) = recorder {
        recorder.finish(&mapper)?;
    }
    let counts = mapper.map().counts();
    Ok(ReplayReport {
        has_cameras: frames.has_cameras(),
        bag: frames.report(),
        main_nodes: counts.main_nodes,
        support_nodes: counts.support_nodes,
        edges: counts.edges,
        free_area_m2: mapper.free_area_m2(),
        version,
        digest: mapper.map().digest(),
        map_bytes: 0,
        wire_bytes: 0,
        delivered: false,
        frames_refused,
        closures: [mapper.closures().near, mapper.closures().far],
        driven_m,
        bag_s: last_us as f64 * 1e-6,
        frame_max_ms: frame_max.as_secs_f64() * 1e3,
        wall_s: begin.elapsed().as_secs_f64(),
    })
}
