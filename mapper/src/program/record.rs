//! A mapping run as a bag: what the sensors said, and what the robot made of it.

use crate::mapping::{Located, Mapper};
use crate::run::{MappedFrame, MappingObserver};
use crate::slam::Anchored;
use fht_bag::msg::{
    Color, MapMetaData, Marker, MarkerArray, OccupancyGridMsg as GridMessage, PathMsg as PathMessage, Pose,
    PoseStamped, Vector3,
};
use fht_bag::{Durability, FrameRecording, Recorder, WriteError, WriteReport};
use fht_bag::{header_message, pose_message};
use fht_map::MapState;
use fht_perception::frame::SensorFrame;
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::Pose2;
use fht_proto::{NodeId, NodeKind};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Time between two grids, paths and pictures of the map, microseconds.
const PERIOD_US: u64 = 5_000_000;
/// Distance between the points of the path, metres.
const PATH_STEP_M: f64 = 0.1;
/// The paper's colours.
const MAIN: Color = Color { r: 0.86, g: 0.15, b: 0.15, a: 1.0 };
const SUPPORT: Color = Color { r: 0.98, g: 0.80, b: 0.10, a: 1.0 };
const RECTANGLE: Color = Color { r: 0.15, g: 0.65, b: 0.25, a: 0.6 };
const EDGE: Color = Color { r: 0.35, g: 0.35, b: 0.35, a: 0.9 };

/// Writes a mapping run: the frames ([`FrameRecording`]), and every five seconds `/map`
/// (`OccupancyGrid`), `/path` and `/fht_map` (`MarkerArray`: main nodes red, support nodes yellow,
/// rectangles green).
struct MapRecorder {
    recorder: Recorder,
    frames: Arc<Mutex<FrameRecording>>,
    next_map_us: u64,
    /// The way driven, a point every [`PATH_STEP_M`].
    path: Vec<(u64, Anchored)>,
}

impl MapRecorder {
    /// Begins a bag at `path`: an `.mcap` file, or else a folder.
    ///
    /// # Errors
    /// [`WriteError`] when something is there already or cannot be made.
    fn start(path: &Path) -> Result<Self, WriteError> {
        Ok(Self { recorder: Recorder::start(path)?, frames: Arc::default(), next_map_us: 0, path: Vec::new() })
    }

    /// Writes a frame that `mapper` has taken in. Waits for the disk if it is far behind.
    fn record(&mut self, frame: &SensorFrame, mapper: &Mapper) {
        let map_from_base = mapper.latest().map(|latest| latest.map_from_base);
        self.path
            .extend(mapper.latest().filter(|latest| self.is_step(latest, mapper)).map(|it| (it.time_us, it.anchored)));
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

    fn is_step(&self, latest: &Located, mapper: &Mapper) -> bool {
        let Some((_, before)) = self.path.last() else { return true };
        let way = mapper.locate(before).translation.vector - latest.map_from_base.translation.vector;
        way.norm() >= PATH_STEP_M
    }

    fn record_map(&self, time_us: u64, mapper: &Mapper) {
        let grid = mapper.grid().clone();
        let path = path_message(time_us, self.path.iter().map(|(at_us, anchored)| (*at_us, mapper.locate(anchored))));
        let markers = markers(time_us, mapper.map());
        self.recorder.submit(move |bag| {
            bag.write("/map", Durability::TransientLocal, time_us, &grid_message(time_us, &grid))?;
            bag.write("/path", Durability::Volatile, time_us, &path)?;
            bag.write("/fht_map", Durability::TransientLocal, time_us, &markers)
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

    /// Whether all was written, after the run's end.
    ///
    /// # Errors
    /// The first [`WriteError`] of the run; what was written before it can be read.
    pub(super) fn finish(&mut self) -> Result<(), WriteError> {
        self.outcome.take().transpose().map(|_| ())
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

fn grid_message(time_us: u64, grid: &OccupancyGrid) -> GridMessage {
    let bounds = grid.bounds();
    let cells = (bounds.min.j..bounds.max.j).flat_map(|j| (bounds.min.i..bounds.max.i).map(move |i| Cell { i, j }));
    let value = |cell| match grid.state(cell) {
        CellState::Free => 0,
        CellState::Occupied => 100,
        CellState::Unknown => -1,
    };
    let metres = |index: i32| f64::from(index) * grid.resolution_m();
    let origin = Vector3 { x: metres(bounds.min.i), y: metres(bounds.min.j), z: 0.0 };
    let header = header_message(time_us, "map");
    GridMessage {
        info: MapMetaData {
            map_load_time: header.stamp,
            resolution: grid.resolution_m() as f32,
            width: bounds.width() as u32,
            height: bounds.height() as u32,
            origin: Pose { position: origin, ..Pose::default() },
        },
        header,
        data: cells.map(value).collect(),
    }
}

fn path_message(time_us: u64, path: impl Iterator<Item = (u64, Pose2)>) -> PathMessage {
    let stamped =
        |(at_us, pose): (u64, Pose2)| PoseStamped { header: header_message(at_us, "map"), pose: pose_message(&pose) };
    PathMessage { header: header_message(time_us, "map"), poses: path.map(stamped).collect() }
}

fn markers(time_us: u64, map: &MapState) -> MarkerArray {
    let place =
        |id: NodeId| map.node(id).map(|node| Vector3 { x: node.pose.position.x(), y: node.pose.position.y(), z: 0.0 });
    let nodes = |kind: NodeKind| {
        map.nodes().filter(|node| node.kind == kind).filter_map(|node| place(node.id)).collect::<Vec<_>>()
    };
    let edges = map.edges().filter_map(|edge| Some([place(edge.low())?, place(edge.high())?]));
    let rectangles = map.nodes().filter_map(|node| {
        let rect = node.free_space?;
        let ((west, south), (east, north)) = (rect.min(node.pose.position), rect.max(node.pose.position));
        let corner = |x, y| Vector3 { x, y, z: 0.0 };
        let corners = [corner(west, south), corner(east, south), corner(east, north), corner(west, north)];
        Some((0..4).flat_map(move |side| [corners[side], corners[(side + 1) % 4]]))
    });
    let marker = |ns: &str, kind: i32, width: f64, color: Color, points: Vec<Vector3>| Marker {
        header: header_message(time_us, "map"),
        ns: ns.to_owned(),
        kind,
        scale: Vector3 { x: width, y: width, z: width },
        color,
        points,
        ..Marker::default()
    };
    MarkerArray {
        markers: vec![
            marker("rectangles", Marker::LINE_LIST, 0.03, RECTANGLE, rectangles.flatten().collect()),
            marker("edges", Marker::LINE_LIST, 0.04, EDGE, edges.flatten().collect()),
            marker("support nodes", Marker::SPHERE_LIST, 0.2, SUPPORT, nodes(NodeKind::Support)),
            marker("main nodes", Marker::SPHERE_LIST, 0.3, MAIN, nodes(NodeKind::Main)),
        ],
    }
}
