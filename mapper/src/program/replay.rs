//! Mapping from a bag: the frames come from a recorded run, and somebody else has driven.

use super::keeping::{KeepError, Kept, RunKeeper};
use super::map_figures::MapFigures;
use super::picture::PictureTask;
use crate::explore::Ending;
use crate::mapping::Mapper;
use crate::run::{self, MappedFrame, MappingObserver, MappingOutcome, MappingTask, RunError};
use fht_bag::{BagError, BagReport, FrameConfig, Frames};
use fht_perception::frame::SensorFrame;
use fht_perception::robot::{Paced, RobotError, Sensors, SilenceConfig};
use fht_program::stop::Stop;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What to replay and where to publish.
#[derive(Clone, Debug)]
pub struct ReplayTask {
    /// The bag: an MCAP file or a folder.
    pub bag: PathBuf,
    /// How it becomes frames.
    pub frames: FrameConfig,
    /// What to map, and where to publish it; cameras are used if the bag has them.
    pub mapping: MappingTask,
    /// Recorded seconds per second; `None` is as fast as possible.
    pub rate: Option<f64>,
    /// A bag to write, with the map in it.
    pub record: Option<PathBuf>,
    /// A picture to make of the map at the end.
    pub picture: Option<PictureTask>,
    /// Ends the replay early, with the map finished as it is.
    pub stop: Stop,
}

/// Why a replay failed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The bag does not become frames.
    #[error(transparent)]
    Frames(#[from] BagError),
    /// No frame came of it.
    #[error("the bag gave no frame to map from\n{0}")]
    NoFrames(Box<BagReport>),
    /// The recording cannot be.
    #[error(transparent)]
    Keep(#[from] KeepError),
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The recorded run cannot be sensed with: a defect.
    #[error(transparent)]
    Robot(RobotError),
}

impl ReplayError {
    /// Whether what was given is wrong, and not the run.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Frames(_) | Self::NoFrames(_) => true,
            Self::Keep(error) => error.is_input(),
            Self::Run(error) => error.is_input(),
            _ => false,
        }
    }
}

impl From<RobotError> for ReplayError {
    fn from(error: RobotError) -> Self {
        match error {
            RobotError::Driver(reason) => match reason.downcast::<BagError>() {
                Ok(error) => Self::Frames(*error),
                Err(reason) => Self::Robot(RobotError::Driver(reason)),
            },
            error => Self::Robot(error),
        }
    }
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
    /// Increments that this robot has written, those of its earlier runs included.
    pub written: u64,
    /// Of these, what the server has durably.
    pub acknowledged: u64,
}

/// Figures of a replay.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ReplayReport {
    /// What became of the bag's messages.
    pub bag: BagReport,
    /// Whether nodes carry descriptors: the bag has four cameras.
    pub has_cameras: bool,
    /// The map, and why the replay ended: `complete`, or `interrupted`.
    #[serde(flatten)]
    pub map: MapFigures,
    /// Free area on the grid, square metres.
    pub free_area_m2: f64,
    /// Frames that nothing could be made of.
    pub frames_refused: usize,
    /// Distance driven by the wheels' word, metres.
    pub driven_m: f64,
    /// Time from the first frame to the last, seconds.
    pub bag_s: f64,
    /// Seconds on the clock.
    pub wall_s: f64,
    /// What else was left of it.
    #[serde(flatten)]
    pub kept: Kept,
}

/// Time between two looks at the progress, microseconds.
const WATCH_EVERY_US: u64 = 1_000_000;

/// Bytes read so far and bytes of the bag, for others to look at.
type ReadSoFar = Arc<Mutex<(u64, u64)>>;

/// A recorded run that says how much of it was read.
struct RecordedRun {
    frames: Frames,
    read: ReadSoFar,
}

impl Sensors for RecordedRun {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        let frame = self.frames.sense().await;
        *self.read.lock().unwrap_or_else(PoisonError::into_inner) = self.frames.progress();
        frame
    }
}

/// Collects the figures of a replay, and tells `watch` about once a recorded second.
struct Figures<W> {
    watch: W,
    read: ReadSoFar,
    began: Instant,
    took: Duration,
    next_us: u64,
    last_us: u64,
    frames: usize,
    driven_m: f64,
    last_odom: Option<Vector2<f64>>,
}

impl<W: FnMut(ReplaySnapshot)> MappingObserver for Figures<W> {
    fn on_start(&mut self, _: &Mapper) {
        self.began = Instant::now();
    }

    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        self.frames += 1;
        self.last_us = mapped.elapsed_us;
        let odom_from_base = mapped.frame.odom_from_base.translation.vector;
        self.driven_m += self.last_odom.map_or(0.0, |last| (odom_from_base - last).norm());
        self.last_odom = Some(odom_from_base);
        if mapped.elapsed_us >= self.next_us {
            self.next_us = mapped.elapsed_us + WATCH_EVERY_US;
            let counts = mapped.mapper.map().counts();
            let (read_bytes, total_bytes) = *self.read.lock().unwrap_or_else(PoisonError::into_inner);
            (self.watch)(ReplaySnapshot {
                read_bytes,
                total_bytes,
                bag_s: mapped.elapsed_us as f64 * 1e-6,
                frames: self.frames,
                nodes: counts.main_nodes + counts.support_nodes,
                written: mapped.written,
                acknowledged: mapped.acknowledged,
            });
        }
        ControlFlow::Continue(())
    }

    fn on_end(&mut self, _: &Mapper) {
        self.took = self.began.elapsed();
    }
}

/// Maps from a bag and publishes. `watch` is called about once a recorded second from the loop's
/// thread.
///
/// # Errors
/// [`ReplayError`]; a replay that ended is reported even if the server could not be reached
/// (`delivered` false).
pub async fn replay(
    task: ReplayTask,
    watch: impl FnMut(ReplaySnapshot) + Send + 'static,
) -> Result<ReplayReport, ReplayError> {
    let frames = Frames::open(&task.bag, task.frames)?;
    let keeper = RunKeeper::new(task.record.as_deref(), task.picture)?;
    let read = ReadSoFar::default();
    let figures = Figures {
        watch,
        read: Arc::clone(&read),
        began: Instant::now(),
        took: Duration::ZERO,
        next_us: 0,
        last_us: 0,
        frames: 0,
        driven_m: 0.0,
        last_odom: None,
    };
    let mapping = MappingTask {
        // A bag can be replayed: nothing need survive.
        spool: None,
        cameras: frames.has_cameras(),
        max_s: f64::INFINITY,
        // What the sensors did not say then, nobody waits for.
        silence: SilenceConfig::patient(),
        stop: task.stop,
        ..task.mapping
    };
    let sensors = Paced::new(RecordedRun { frames, read }, task.rate);
    report_of(run::observe(mapping, sensors, (keeper, figures)).await?)
}

/// Who watches a replay.
type Watching<W> = (RunKeeper, Figures<W>);

fn report_of<W>(outcome: MappingOutcome<Paced<RecordedRun>, Watching<W>>) -> Result<ReplayReport, ReplayError> {
    let MappingOutcome { mut summary, mapper, robot, observer: (keeper, figures) } = outcome;
    if let Some(error) = summary.robot_error.take() {
        return Err(error.into());
    }
    let frames = robot.into_inner().frames;
    let bag = frames.report();
    if summary.frames + summary.frames_refused == 0 && summary.ending != Ending::Interrupted {
        return Err(ReplayError::NoFrames(Box::new(bag)));
    }
    let kept = keeper.finish(summary.frames)?;
    Ok(ReplayReport {
        bag,
        has_cameras: frames.has_cameras(),
        map: MapFigures::of(&summary, &mapper),
        free_area_m2: mapper.free_area_m2(),
        frames_refused: summary.frames_refused,
        driven_m: figures.driven_m,
        bag_s: figures.last_us as f64 * 1e-6,
        wall_s: figures.took.as_secs_f64(),
        kept,
    })
}
