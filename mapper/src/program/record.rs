//! A mapping run as a bag: what the sensors said, and what the robot made of it.

use super::way::WayDriven;
use crate::mapping::Mapper;
use crate::run::{MappedFrame, MappingObserver};
use fht_bag::write_map;
use fht_bag::{Durability, FrameRecording, Recorder, WriteError, WriteReport};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::Pose2;
use fht_ros_frames::{FloorGrid, header_message, pose_message};
use fht_ros_messages::msg::{PathMsg as PathMessage, PoseStamped};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Time between two grids, paths and pictures of the map, microseconds.
const PERIOD_US: u64 = 5_000_000;

/// Writes a mapping run: the frames ([`FrameRecording`]), and every five seconds `/map`
/// (`OccupancyGrid`), `/path` and `/fht_map` (`MarkerArray`: main nodes red, support nodes yellow,
/// rectangles green).
struct MapRecorder {
    recorder: Recorder,
    frames: Arc<Mutex<FrameRecording>>,
    next_map_us: u64,
    way: WayDriven,
}

impl MapRecorder {
    /// Begins a bag at `path`: an `.mcap` file, or else a folder.
    ///
    /// # Errors
    /// [`WriteError`] when something is there already or cannot be made.
    fn start(path: &Path) -> Result<Self, WriteError> {
        Ok(Self { recorder: Recorder::start(path)?, frames: Arc::default(), next_map_us: 0, way: WayDriven::default() })
    }

    /// Writes a frame that `mapper` has taken in. Waits for the disk if it is far behind.
    fn record(&mut self, frame: &SensorFrame, mapper: &Mapper) {
        let map_from_base = mapper.latest().map(|latest| latest.map_from_base);
        self.way.follow(mapper);
        let (frames, frame) = (self.frames.clone(), frame.clone());
        let time_us = frame.time_us;
        self.recorder.submit(move |bag| {
            let mut frames = frames.lock().unwrap_or_else(PoisonError::into_inner);
            frames.write(bag, &frame, map_from_base.as_ref())
        });
        if time_us >= self.next_map_us {
            self.next_map_us = time_us + PERIOD_US;
            self.record_map(time_us, mapper);
        }
    }

    fn record_map(&self, time_us: u64, mapper: &Mapper) {
        let (grid, map) = (mapper.grid().clone(), mapper.map().clone());
        let path = path_message(time_us, self.way.poses(mapper));
        self.recorder.submit(move |bag| {
            write_map(bag, time_us, &FloorGrid::from(&grid), &map)?;
            bag.write("/path", Durability::Volatile, time_us, &path)
        });
    }

    /// Writes the finished map and ends the bag.
    ///
    /// # Errors
    /// The first [`WriteError`] of the run; what was written before it can be read.
    fn finish(self, mapper: &Mapper) -> Result<WriteReport, WriteError> {
        if let Some(latest) = mapper.latest() {
            self.record_map(latest.time_us, mapper);
        }
        self.recorder.finish()
    }
}

/// Records a run, if it is to be recorded. The bag is made when the loop begins: a run that is
/// interrupted while it waits for a server leaves none.
pub(super) struct RunRecorder {
    path: Option<PathBuf>,
    recorder: Option<MapRecorder>,
    outcome: Option<Result<WriteReport, WriteError>>,
}

impl RunRecorder {
    /// A bag at `path`, if one is given.
    ///
    /// # Errors
    /// [`WriteError`] when something is there already.
    pub(super) fn new(path: Option<&Path>) -> Result<Self, WriteError> {
        if let Some(path) = path.filter(|path| path.exists()) {
            return Err(WriteError::Exists { path: path.to_owned() });
        }
        Ok(Self { path: path.map(Path::to_owned), recorder: None, outcome: None })
    }

    /// The bag in which all was written, after the run's end; none if nothing was to be recorded.
    ///
    /// # Errors
    /// The first [`WriteError`] of the run; what was written before it can be read.
    pub(super) fn finish(&mut self) -> Result<Option<PathBuf>, WriteError> {
        let written = self.outcome.take().transpose()?;
        Ok(written.and(self.path.take()))
    }
}

impl MappingObserver for RunRecorder {
    fn on_start(&mut self, _: &Mapper) {
        match self.path.as_deref().map(MapRecorder::start).transpose() {
            Ok(recorder) => self.recorder = recorder,
            Err(error) => self.outcome = Some(Err(error)),
        }
    }

    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        if let Some(recorder) = &mut self.recorder {
            recorder.record(mapped.frame, mapped.mapper);
        }
        if self.outcome.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn on_end(&mut self, mapper: &Mapper) {
        if let Some(recorder) = self.recorder.take() {
            self.outcome = Some(recorder.finish(mapper));
        }
    }
}

fn path_message(time_us: u64, path: impl Iterator<Item = (u64, Pose2)>) -> PathMessage {
    let stamped =
        |(at_us, pose): (u64, Pose2)| PoseStamped { header: header_message(at_us, "map"), pose: pose_message(&pose) };
    PathMessage { header: header_message(time_us, "map"), poses: path.map(stamped).collect() }
}
