//! One exploration, frame by frame: SLAM, construction, refinement, and where to drive next.
//!
//! Pure of I/O: frames go in, a command and increments come out. Cameras, refinement and SLAM's
//! back end work in threads beside it ([`fht_worker`]).

mod config;
mod others;
mod shared;
mod shortcuts;

pub use config::MapperConfig;

use crate::camera::{CameraError, CameraWorker};
use crate::construct::{
    Builder, Footing, PlaceObservation, RefinementJob, Roadmap, Shortcut, shortcuts, start_refinement,
};
use crate::explore::{Ending, ExploreStep, Explorer, Search, SearchResult};
use crate::haste::Haste;
use crate::publish::Journal;
use crate::slam::{Anchored, ClosureCounts, Slam, Tracking};
use fht_descriptor::{Appearance, DescriptorNet};
use fht_map::MapState;
use fht_navigation::people::{Bystanders, keep_distance};
use fht_navigation::planning::Traversable;
use fht_perception::frame::{FrameError, SensorFrame, Twist};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2};
use fht_proto::{AuthorId, Descriptor, DescriptorModel, Increment, NodeId, Op, ScanRecord};
use fht_worker::BackgroundWorker;
use others::{Newcomer, Others};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

/// Frames between a question where to go and its answer.
const GOAL_DELAY_FRAMES: u64 = 1;
/// Operations of one increment, when there are many.
const BATCH_OPS: usize = 64;

/// The cosine that means "near", of a model.
fn match_threshold(model: &DescriptorModel) -> f32 {
    f32::from(model.match_threshold_e3) * 1e-3
}

/// What an exploration is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapperStep {
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
    bystanders: Bystanders,
    goals: BackgroundWorker<(Search, OccupancyGrid), SearchResult>,
    camera: Option<CameraWorker<SensedPlace>>,
    /// What the descriptors are of.
    model: Option<DescriptorModel>,
    is_model_written: bool,
    /// A robot that is to join a map and does not know yet where in it it is.
    newcomer: Option<Newcomer>,
    others: Others,
    odometer_m: f64,
    began_us: u64,
    refine: BackgroundWorker<RefinementJob, Vec<Shortcut>>,
    to_refine: VecDeque<NodeId>,
    frame: u64,
    increments: Vec<Increment>,
    latest: Option<Located>,
}

/// What belongs to a panorama: where and when it was taken, and the scan.
struct SensedPlace {
    anchored: Anchored,
    frame: u64,
    scan: ScanRecord,
}

/// Where the robot was at a frame.
#[derive(Clone, Copy, Debug)]
pub struct Located {
    /// Time of the frame, microseconds.
    pub time_us: u64,
    /// Pose in the map frame, as known then.
    pub map_from_base: Pose2,
    /// The same, to be looked up again when more is known ([`Mapper::locate`]).
    pub anchored: Anchored,
    /// How well it is known.
    pub tracking: Tracking,
}

impl Mapper {
    /// Before the first frame. Without a `net` nodes carry scans only.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn new(config: MapperConfig, author: AuthorId, net: Option<DescriptorNet>) -> std::io::Result<Self> {
        let model = net.as_ref().map(|net| net.model().clone());
        Ok(Self {
            slam: Slam::new(config.slam.clone(), config.pace)?,
            builder: Builder::new(config.builder.clone()),
            journal: Journal::new(author),
            explorer: Explorer::new(config.explore.clone()),
            bystanders: Bystanders::new(config.people.clone()),
            goals: BackgroundWorker::one_by_one("goals", config.pace, |(search, grid): (Search, OccupancyGrid)| {
                search.run(&grid)
            })?,
            camera: net.map(|net| CameraWorker::start(net, config.pace)).transpose()?,
            model,
            is_model_written: false,
            newcomer: None,
            others: Others::default(),
            odometer_m: 0.0,
            began_us: 0,
            refine: start_refinement(config.refine.clone(), config.pace)?,
            to_refine: VecDeque::new(),
            frame: 0,
            increments: Vec::new(),
            latest: None,
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

    /// The way to what the robot is going to see, map frame; empty while it goes nowhere.
    #[must_use]
    pub fn way_ahead(&self) -> &[Point2] {
        self.explorer.path()
    }

    /// Where the robot was at the newest frame.
    #[must_use]
    pub fn latest(&self) -> Option<&Located> {
        self.latest.as_ref()
    }

    /// Where something is in the map, as known by now.
    #[must_use]
    pub fn locate(&self, anchored: &Anchored) -> Pose2 {
        self.slam.locate(anchored)
    }

    /// What the nodes hang on.
    #[must_use]
    pub fn footings(&self) -> &BTreeMap<NodeId, Footing> {
        self.builder.footings()
    }

    /// What loop closure has done.
    #[must_use]
    pub fn closures(&self) -> ClosureCounts {
        self.slam.counts()
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
    ///
    /// # Errors
    /// As [`observe`](Self::observe).
    pub fn step(&mut self, frame: &SensorFrame) -> Result<MapperStep, FrameError> {
        let map_from_base = self.observe(frame)?;
        if self.is_waiting(frame.time_us) {
            return Ok(MapperStep::Drive(Twist::default()));
        }
        if let Some(answer) = self.goals.take_due(self.frame) {
            self.explorer.answer(answer);
        }
        let step = self.explorer.step(self.slam.grid(), &map_from_base, &frame.scan, frame.time_us);
        if self.goals.is_idle()
            && let Some(search) = self.explorer.question()
        {
            let mut grid = self.slam.grid().clone();
            let is_among_people = self.bystanders.suppose(&mut grid, &map_from_base);
            let search = search.over(|| self.journal.state().clone()).among_people(is_among_people);
            self.goals.submit((search, grid), self.frame + GOAL_DELAY_FRAMES);
        }
        Ok(match step {
            _ if self.goals.has_ended() => MapperStep::Done(Ending::Stuck),
            ExploreStep::Drive(twist) => MapperStep::Drive(self.give_way(twist, frame.time_us)),
            ExploreStep::Done(_) if self.newcomer.is_some() => MapperStep::Done(Ending::Unplaced),
            ExploreStep::Done(ending) => MapperStep::Done(ending),
        })
    }

    /// A command that keeps its distance from people.
    fn give_way(&mut self, wanted: Twist, time_us: u64) -> Twist {
        let command = keep_distance(wanted, &self.bystanders.around(), &self.config.explore.distance);
        if command.linear_mps == 0.0 && wanted.linear_mps != 0.0 {
            self.explorer.give_way(time_us);
        }
        command
    }

    /// Takes in a frame of a robot that somebody else drives (a recorded run), and says where the
    /// robot is. The map is the same as with [`step`](Self::step).
    ///
    /// # Errors
    /// [`FrameError`] for a frame that nothing can be made of; it changes nothing.
    pub fn observe(&mut self, frame: &SensorFrame) -> Result<Pose2, FrameError> {
        frame.check()?;
        let frame = &*self.bystanders.hide(frame);
        if self.bystanders.has_met() {
            self.builder.expect_people();
        }
        let update = self.slam.update(frame);
        let (time_us, map_from_base, anchored) = (frame.time_us, update.map_from_base, update.anchored);
        if let Some(before) = &self.latest {
            let way = before.map_from_base.translation.vector - map_from_base.translation.vector;
            self.odometer_m += way.norm();
        } else {
            self.began_us = time_us;
        }
        self.latest = Some(Located { time_us, map_from_base, anchored, tracking: update.tracking });
        if self.newcomer.is_some() {
            self.find_itself(frame, &anchored, update.tracking);
            self.frame += 1;
            return Ok(self.slam.locate(&anchored));
        }
        if !self.is_model_written {
            self.is_model_written = true;
            let ops = self.model.iter().map(|model| Op::PutModel { model: model.clone() }).collect();
            self.write(ops, time_us);
        }
        if update.is_corrected {
            self.follow(time_us);
        }
        // A robot that is lost does not know what it would be mapping.
        if update.tracking != Tracking::Lost {
            self.observe_place(frame, &anchored);
            let made = self.builder.observe_motion(&anchored, &mut self.journal, &self.slam.estimate());
            self.take_node(made, time_us);
            self.doubt(&map_from_base, time_us);
        }
        self.refine(time_us);
        self.frame += 1;
        Ok(map_from_base)
    }

    /// Keyframes have moved: the map follows.
    fn follow(&mut self, time_us: u64) {
        let (ops, moved) = self.builder.follow(&self.journal, &self.slam.estimate());
        if moved.is_empty() {
            return;
        }
        self.write_all(&ops, time_us);
        let (ops, cut) = self.builder.mend(&moved, &self.journal, self.slam.grid());
        self.write_all(&ops, time_us);
        for node in cut {
            self.look_for_shortcuts(node);
        }
    }

    /// Main nodes: from the panorama before this one, whose descriptor is ready by now.
    fn observe_place(&mut self, frame: &SensorFrame, anchored: &Anchored) {
        if self.camera.is_some() && frame.panorama.is_none() {
            return;
        }
        let scan = self.bystanders.hide_doubtful(frame).to_record();
        let seen = SensedPlace { anchored: *anchored, frame: self.frame, scan };
        let Some(camera) = &mut self.camera else {
            // No cameras: every frame is a place without an appearance.
            return self.take_place(seen, None, 1.0, frame.time_us);
        };
        if let Some(panorama) = &frame.panorama
            && let Some((seen, appearance)) = camera.exchange(panorama.clone(), seen, self.frame)
        {
            self.take_appearance(seen, appearance, frame.time_us);
        }
    }

    fn take_appearance(&mut self, seen: SensedPlace, appearance: Appearance, time_us: u64) {
        let model = self.model.as_ref();
        let descriptor = model.map(|model| Descriptor::quantise(model.id, &appearance.components));
        if let Some(threshold) = model.map(match_threshold) {
            self.slam.observe_appearance(&seen.anchored, Arc::new(appearance.components), threshold);
        }
        self.take_place(seen, descriptor, appearance.information, time_us);
    }

    fn take_place(&mut self, seen: SensedPlace, descriptor: Option<Descriptor>, information: f64, time_us: u64) {
        let SensedPlace { anchored, frame, scan } = seen;
        let observation = PlaceObservation { anchored, frame, scan, descriptor, information };
        let made = self.builder.observe_place(observation, &mut self.journal, &self.slam.estimate());
        self.take_node(made, time_us);
    }

    fn take_node(&mut self, made: Option<(NodeId, Vec<Op>)>, time_us: u64) {
        let Some((id, ops)) = made else { return };
        self.write(ops, time_us);
        self.look_for_shortcuts(id);
    }

    fn write_all(&mut self, ops: &[Op], time_us: u64) {
        for batch in ops.chunks(BATCH_OPS) {
            self.write(batch.to_vec(), time_us);
        }
    }

    fn write(&mut self, ops: Vec<Op>, time_us: u64) {
        self.increments.extend(self.journal.write(ops, time_us));
    }

    /// After the last frame: what is under way is finished, places passed become main nodes where
    /// too little is known, rectangles are grown once more, and every node is looked at for
    /// shortcuts in the finished grid.
    pub fn finish(&mut self) {
        self.finish_while(&Haste::none());
    }

    /// The same with what there is time for. What is left undone are a last look at all loop
    /// closures, main nodes at places that are known well enough, free space that few miss, and
    /// shortcuts.
    pub fn finish_while(&mut self, haste: &Haste) {
        if self.newcomer.is_some() {
            return; // what it saw has no place in the map
        }
        let time_us = self.latest.map_or(0, |latest| latest.time_us);
        if let Some((seen, appearance)) = self.camera.as_mut().and_then(CameraWorker::finish) {
            self.take_appearance(seen, appearance, time_us);
        }
        let due = self.refine.finish();
        self.add_shortcuts(due.unwrap_or_default(), time_us);
        self.slam.finish_while(haste);
        self.follow(time_us);
        for place in self.builder.take_unknown(&self.journal, &self.slam.estimate()) {
            if !haste.has_time() {
                break;
            }
            let made = self.builder.make_main(place, &mut self.journal, &self.slam.estimate());
            self.take_node(Some(made), time_us);
        }
        let ops = self.builder.finish(&self.journal, self.slam.grid());
        self.write_all(&ops, time_us);
        if self.bystanders.has_met() {
            let ops = self.builder.leave_out_doubtful(&self.journal);
            self.write_all(&ops, time_us);
        }
        let ops = self.builder.cover(&mut self.journal, &self.slam.estimate(), haste);
        self.write_all(&ops, time_us);
        let space = Traversable::new(self.slam.grid(), &self.plan_config());
        let own = self.map().nodes().map(|node| node.id).filter(|id| self.builder.is_own(*id));
        let nodes: Vec<NodeId> = own.collect();
        let mut roadmap = Roadmap::of(self.map());
        for node in nodes {
            if !haste.has_time() {
                break;
            }
            let found = shortcuts(&roadmap, &space, node, &self.config.refine);
            let before = self.increments.len();
            self.add_shortcuts(found, time_us);
            self.increments[before..].iter().for_each(|increment| roadmap.add_put_by(increment));
        }
    }

    /// Area of the map's rectangles and the grid, for people: free square metres known.
    #[must_use]
    pub fn free_area_m2(&self) -> f64 {
        self.grid().free_area_m2()
    }
}
