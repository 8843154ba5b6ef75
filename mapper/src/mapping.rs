//! One exploration, frame by frame: SLAM, construction, refinement, and where to drive next.
//!
//! Pure of I/O: frames go in, a command and increments come out. Camera and refinement work in threads beside it and
//! are joined at fixed frames, so the same frames give the same map.

use crate::camera::{CameraError, CameraWorker};
use crate::construct::{Builder, BuilderConfig, Chain, Observation, point};
use crate::explore::{Ending, ExploreConfig, ExploreStep, Explorer};
use crate::journal::Journal;
use crate::refine::{RefineConfig, RefineJob, RefineWorker, Roadmap, Shortcut, is_still_free, shortcuts};
use crate::slam::{Slam, SlamConfig};
use fht_map::MapState;
use fht_proto::{AuthorId, Descriptor, DescriptorModel, Increment, NodeId, Op};
use fht_robot::descriptor::{Appearance, DescriptorNet};
use fht_robot::frame::{SensorFrame, Twist};
use fht_robot::grid::OccupancyGrid;
use fht_robot::planning::{PlanConfig, Traversable, UnknownCells};
use fht_robot::pose::{Point2, Pose2};
use std::collections::VecDeque;

/// Parameters of an exploration.
#[derive(Clone, Debug, Default)]
pub struct MapperConfig {
    /// SLAM.
    pub slam: SlamConfig,
    /// Nodes, edges, rectangles.
    pub builder: BuilderConfig,
    /// Shortcuts.
    pub refine: RefineConfig,
    /// Where to go.
    pub explore: ExploreConfig,
}

/// Frames between a refinement job and its result.
const REFINE_DELAY_FRAMES: u64 = 10;
/// New nodes that wait for refinement; the oldest is dropped beyond (the last pass looks at all nodes again).
const REFINE_QUEUE: usize = 64;

/// What an exploration is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// Drive on.
    Drive(Twist),
    /// It is over, complete or stuck.
    Done(Ending),
}

/// An exploration in progress.
pub struct Mapper {
    config: MapperConfig,
    slam: Slam,
    builder: Builder,
    journal: Journal,
    explorer: Explorer,
    camera: Option<CameraWorker<(Pose2, fht_proto::ScanRecord)>>,
    model: Option<DescriptorModel>,
    refine: RefineWorker,
    to_refine: VecDeque<NodeId>,
    frame: u64,
    increments: Vec<Increment>,
    trajectory: Vec<(u64, Pose2)>,
}

impl Mapper {
    /// Before the first frame. Without a `net` nodes carry scans only.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn new(config: MapperConfig, author: AuthorId, net: Option<DescriptorNet>) -> std::io::Result<Self> {
        let model = net.as_ref().map(|net| net.model().clone());
        Ok(Self {
            slam: Slam::new(config.slam.clone(), crate::beside::Pace::Repeatable)?,
            builder: Builder::new(config.builder.clone()),
            journal: Journal::new(author),
            explorer: Explorer::new(config.explore.clone()),
            camera: net.map(CameraWorker::start).transpose()?,
            model,
            refine: RefineWorker::start(config.refine.clone(), REFINE_DELAY_FRAMES)?,
            to_refine: VecDeque::new(),
            frame: 0,
            increments: Vec::new(),
            trajectory: Vec::new(),
            config,
        })
    }

    /// The map so far.
    #[must_use]
    pub fn map(&self) -> &MapState {
        self.journal.state()
    }

    /// The occupancy grid so far.
    #[must_use]
    pub fn grid(&self) -> &OccupancyGrid {
        self.slam.grid()
    }

    /// Time and estimated pose of every frame.
    #[must_use]
    pub fn trajectory(&self) -> &[(u64, Pose2)] {
        &self.trajectory
    }

    /// Whether nodes still get what the task asked for.
    ///
    /// # Errors
    /// [`CameraError`]: too many panoramas in a row could not be described.
    pub fn check(&self) -> Result<(), CameraError> {
        self.camera.as_ref().map_or(Ok(()), CameraWorker::check)
    }

    /// The increments written since the last call, in order.
    pub fn take_increments(&mut self) -> Vec<Increment> {
        std::mem::take(&mut self.increments)
    }

    /// Takes in a frame and says what to do next.
    pub fn step(&mut self, frame: &SensorFrame) -> Step {
        let map_from_base = self.observe(frame);
        match self.explorer.step(self.slam.grid(), &map_from_base, &frame.scan, frame.time_us) {
            ExploreStep::Drive(twist) => Step::Drive(twist),
            ExploreStep::Done(ending) => Step::Done(ending),
        }
    }

    /// Takes in a frame of a robot that somebody else drives (a recorded run), and says where the robot is. The map is the
    /// same as with [`step`](Self::step).
    pub fn observe(&mut self, frame: &SensorFrame) -> Pose2 {
        let update = self.slam.update(frame);
        let map_from_base = update.map_from_base;
        self.trajectory.push((frame.time_us, map_from_base));
        if let Some(model) = self.model.take() {
            self.write(vec![Op::PutModel { model }], frame.time_us);
        }
        self.see(frame, &map_from_base);
        let made = self.builder.observe_motion(&map_from_base, &mut self.journal, self.slam.grid());
        self.take_node(made, frame.time_us);
        self.refine(frame.time_us);
        self.frame += 1;
        map_from_base
    }

    /// Main nodes: from the panorama before this one, whose descriptor is ready by now.
    fn see(&mut self, frame: &SensorFrame, map_from_base: &Pose2) {
        let Some(camera) = &mut self.camera else {
            // No cameras: every frame is a place without an appearance.
            let observation = Observation {
                map_from_base: *map_from_base,
                scan: frame.scan.to_record(),
                descriptor: None,
                information: 1.0,
            };
            let made = self.builder.observe_place(observation, &mut self.journal, self.slam.grid());
            return self.take_node(made, frame.time_us);
        };
        if let Some(panorama) = &frame.panorama {
            let seen = camera.exchange(panorama.clone(), (*map_from_base, frame.scan.to_record()));
            self.take_appearance(seen, frame.time_us);
        }
    }

    fn take_appearance(&mut self, seen: Option<((Pose2, fht_proto::ScanRecord), Appearance)>, time_us: u64) {
        let Some(((map_from_base, scan), appearance)) = seen else { return };
        let descriptor = self.map().models().next().map(|model| Descriptor::quantise(model.id, &appearance.components));
        let observation = Observation { map_from_base, scan, descriptor, information: appearance.information };
        let made = self.builder.observe_place(observation, &mut self.journal, self.slam.grid());
        self.take_node(made, time_us);
    }

    fn take_node(&mut self, made: Option<(NodeId, Vec<Op>)>, time_us: u64) {
        let Some((id, ops)) = made else { return };
        self.write(ops, time_us);
        if self.to_refine.len() >= REFINE_QUEUE {
            self.to_refine.pop_front();
        }
        self.to_refine.push_back(id);
    }

    fn write(&mut self, ops: Vec<Op>, time_us: u64) {
        self.increments.extend(self.journal.write(ops, time_us));
    }

    fn refine(&mut self, time_us: u64) {
        let due = self.refine.take_due(self.frame);
        self.add_shortcuts(due, time_us);
        if self.refine.is_idle()
            && let Some(node) = self.to_refine.pop_front()
        {
            let job = RefineJob { roadmap: Roadmap::of(self.map()), space: self.free_space(), node };
            self.refine.submit(job, self.frame);
        }
    }

    /// Free space as edges need it: with the robot's width, unknown cells as walls.
    fn free_space(&self) -> Traversable {
        let width = self.builder.config().edges.half_width_m;
        // Half a cell more than the edges ask for: a path over cell centres is a little inexact.
        let robot_radius_m = width + 0.5 * self.grid().resolution_m();
        let config = PlanConfig { robot_radius_m, unknown: UnknownCells::Obstacle, ..PlanConfig::shortest() };
        Traversable::new(self.slam.grid(), &config)
    }

    fn add_shortcuts(&mut self, found: Vec<Shortcut>, time_us: u64) {
        for shortcut in found {
            let width_m = self.builder.config().edges.half_width_m;
            if is_still_free(&shortcut, self.journal.state(), self.slam.grid(), width_m) {
                let chain = Chain { from: shortcut.from, between: &shortcut.between, to: shortcut.to };
                let ops = self.builder.make_chain(&chain, &mut self.journal, self.slam.grid());
                self.write(ops, time_us);
            }
        }
    }

    /// After the last frame: what is under way is finished, rectangles are grown once more, and every node is looked
    /// at for shortcuts in the finished grid.
    pub fn finish(&mut self) {
        let time_us = self.trajectory.last().map_or(0, |(time_us, _)| *time_us);
        if let Some(seen) = self.camera.as_mut().and_then(CameraWorker::finish) {
            self.take_appearance(Some(seen), time_us);
        }
        let due = self.refine.take_due(u64::MAX);
        self.add_shortcuts(due, time_us);
        let ops = self.builder.finish(&self.journal, self.slam.grid());
        for batch in ops.chunks(64) {
            self.write(batch.to_vec(), time_us);
        }
        let space = self.free_space();
        let nodes: Vec<NodeId> = self.map().nodes().map(|node| node.id).collect();
        for node in nodes {
            let found = shortcuts(Roadmap::of(self.map()), &space, node, &self.config.refine);
            self.add_shortcuts(found, time_us);
        }
    }

    /// Area of the map's rectangles and the grid, for people: free square metres known.
    #[must_use]
    pub fn free_area_m2(&self) -> f64 {
        self.grid().free_area_m2()
    }

    /// Where a node is, on the grid.
    #[must_use]
    pub fn node_place(&self, id: NodeId) -> Option<Point2> {
        self.map().node(id).map(|node| point(node.pose.position))
    }
}
