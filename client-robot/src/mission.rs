//! A robot with a task in a simulated world: frames from the simulator, decisions from the pilot, figures for the report.
//! Driven by simulated time only, so that the same map, world and seeds give the same run.

use crate::inquiry::Taking;
use crate::landmarks::Landmarks;
use crate::pilot::{Failure, Outcome, PathSource, Pilot, PilotConfig, Step, Task};
use crate::preparation::Preparation;
use crate::replica::LiveReplica;
use crate::report::{Report, error};
use crate::route::Planner;
use fht_map::MapState;
use fht_proto::query::{ErrorCode, ErrorReply};
use fht_proto::{Descriptor, Label, NodeId};
use fht_robot::frame::{Panorama, SensorFrame};
use fht_robot::pose::{Point2, Pose2};
use fht_sim::Simulator;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A map that may change while it is used.
pub trait MapView {
    /// A number that changes whenever the map does.
    fn changes(&self) -> u64;
    /// Looks at the map.
    fn view(&self, look: &mut dyn FnMut(&MapState));
}

impl MapView for LiveReplica {
    fn changes(&self) -> u64 {
        Self::changes(self)
    }
    fn view(&self, look: &mut dyn FnMut(&MapState)) {
        look(&self.running());
    }
}

impl MapView for MapState {
    fn changes(&self) -> u64 {
        1
    }
    fn view(&self, look: &mut dyn FnMut(&MapState)) {
        look(self);
    }
}

/// Where to go once the place is known.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// Nowhere: knowing the place is all.
    None,
    /// A point of the map frame, metres.
    Point(Point2),
    /// A node of the map.
    Node(NodeId),
    /// A place that an operator has named.
    Named(Label),
    /// A node far from the robot, drawn by this seed.
    FarNode(u64),
}

/// What a robot needs besides its sensors.
pub struct Services<'a> {
    /// The map.
    pub map: &'a dyn MapView,
    /// Paths.
    pub paths: &'a mut dyn PathSource,
    /// The descriptor of a panorama.
    pub describe: &'a mut dyn FnMut(&Panorama) -> Option<Descriptor>,
    /// Told of every frame: the frame and what it led to.
    pub on_frame: &'a mut dyn FnMut(&SensorFrame, &Step),
}

/// Frames between points of the trajectories: 0.6 s.
const TRAJECTORY_EVERY: usize = 3;

/// Frames after a change of the map at which its walls are used: 0.4 s.
const WALLS_AFTER_FRAMES: u32 = 2;

/// Runs a mission to its end. `world_from_map` is for scoring only.
pub fn run(
    simulator: &mut Simulator,
    config: PilotConfig,
    goal: Goal,
    world_from_map: &Pose2,
    services: &mut Services<'_>,
) -> Report {
    let mut pilot = Pilot::new(config, Task::Relocalize);
    let mut landmarks = Landmarks::default();
    let mut preparation = Preparation::start(Taking::AfterFrames(WALLS_AFTER_FRAMES));
    let mut seen_changes = None;
    let mut score = Score::new(simulator, world_from_map);
    let mut frame = simulator.sense_first();
    let mut frames = 0_usize;
    loop {
        let changes = services.map.changes();
        if seen_changes != Some(changes) {
            seen_changes = Some(changes);
            services.map.view(&mut |map| preparation.follow(&mut landmarks, map));
        }
        preparation.take(&mut landmarks);
        let describe = || frame.panorama.as_ref().and_then(|panorama| (services.describe)(panorama));
        let step = pilot.step(&landmarks, &frame, describe, services.paths);
        (services.on_frame)(&frame, &step);
        score.take(simulator, &pilot, &frame, &step, frames.is_multiple_of(TRAJECTORY_EVERY));
        frames += 1;
        match &step.outcome {
            Some(Outcome::Localized) if goal != Goal::None => match choose(&goal, services.map, &step) {
                Some(point) => {
                    score.set_goal(simulator, point);
                    pilot.set_task(Task::GoTo(point));
                }
                None => {
                    let refusal = ErrorReply {
                        code: ErrorCode::UnknownNode,
                        message: "the map has no such node or place".to_owned(),
                    };
                    return score.finish(simulator, &pilot, &Outcome::Failed(Failure::NoPath(refusal)));
                }
            },
            Some(outcome) => return score.finish(simulator, &pilot, outcome),
            None => {}
        }
        frame = simulator.step(step.command);
    }
}

/// The point to go to, now that the robot knows where it is.
fn choose(goal: &Goal, map: &dyn MapView, step: &Step) -> Option<Point2> {
    let here = Point2::from(step.localization.map_from_base()?.translation.vector);
    let mut chosen = None;
    map.view(&mut |map| {
        chosen = match goal {
            Goal::None => None,
            Goal::Point(point) => Some(*point),
            Goal::Named(name) => {
                let pose = map.annotations().place(name);
                pose.map(|pose| Point2::new(pose.position.x(), pose.position.y()))
            }
            Goal::Node(id) => map.node(*id).map(|node| Point2::new(node.pose.position.x(), node.pose.position.y())),
            Goal::FarNode(seed) => {
                let position = |node: fht_map::NodeRef<'_>| Point2::new(node.pose.position.x(), node.pose.position.y());
                let mut places: Vec<Point2> = map.nodes().map(position).collect();
                places.sort_by(|a, b| (b - here).norm().total_cmp(&(a - here).norm()));
                places.truncate(places.len().div_ceil(3));
                let mut rng = ChaCha8Rng::seed_from_u64(*seed);
                let index = rng.random_range(0..places.len().max(1));
                places.get(index).copied()
            }
        };
    });
    chosen
}

/// Collects the figures.
struct Score {
    map_from_world: Pose2,
    report: Report,
    driven_at_fix_m: Option<f64>,
    first_us: Option<u64>,
    last: Option<(Pose2, Pose2)>,
}

impl Score {
    fn new(simulator: &Simulator, world_from_map: &Pose2) -> Self {
        let map_from_world = world_from_map.inverse();
        let start = map_from_world * simulator.truth();
        let start = [start.translation.x, start.translation.y, start.rotation.angle()];
        let report = Report { start, ..Report::default() };
        Self { map_from_world, report, driven_at_fix_m: None, first_us: None, last: None }
    }

    fn take(&mut self, simulator: &Simulator, pilot: &Pilot, frame: &SensorFrame, step: &Step, is_drawn: bool) {
        let truth = self.map_from_world * simulator.truth();
        let report = &mut self.report;
        let first = *self.first_us.get_or_insert(frame.time_us);
        report.sim_s = frame.time_us.saturating_sub(first) as f64 / 1e6;
        if is_drawn {
            report.true_trajectory.push([truth.translation.x, truth.translation.y]);
        }
        if let Some(path) = pilot.path() {
            report.planned_length_m.get_or_insert(path.length_m);
            // The robot plans first and the server answers after: its word is the better.
            if report.planner != Some(Planner::Server) {
                report.planner = Some(path.planner);
            }
        }
        let estimate = step.localization.map_from_base();
        report.localized_at_end = estimate.is_some();
        self.last = estimate.map(|estimate| (estimate, truth));
        let Some(estimate) = estimate else { return };
        let (metres, degrees) = error(&estimate, &truth);
        report.worst_error_m = Some(report.worst_error_m.map_or(metres, |worst| worst.max(metres)));
        if !report.localized {
            report.localized = true;
            report.relocalization_distance_m = Some(simulator.driven_m());
            report.relocalization_error_m = Some(metres);
            report.relocalization_error_deg = Some(degrees);
            report.relocalization_evidence = step.localization.evidence;
            self.driven_at_fix_m = Some(simulator.driven_m());
        }
        if is_drawn {
            report.trajectory.push([estimate.translation.x, estimate.translation.y]);
        }
    }

    fn set_goal(&mut self, simulator: &Simulator, goal: Point2) {
        self.report.goal = Some([goal.x, goal.y]);
        let from = Point2::from(simulator.truth().translation.vector);
        let to = self.map_from_world.inverse() * goal;
        let shortest = simulator.world().plan().shortest_path(from, to, simulator.config().radius_m);
        self.report.shortest_length_m =
            shortest.map(|points| points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum());
    }

    fn finish(mut self, simulator: &Simulator, pilot: &Pilot, outcome: &Outcome) -> Report {
        let report = &mut self.report;
        report.arrived = *outcome == Outcome::Arrived;
        if let Outcome::Failed(failure) = outcome {
            report.failure = Some(failure.to_string());
        }
        if let Some((metres, degrees)) = self.last.map(|(estimate, truth)| error(&estimate, &truth)) {
            report.final_error_m = Some(metres);
            report.final_error_deg = Some(degrees);
        }
        let truth = self.map_from_world * simulator.truth();
        report.goal_distance_m =
            report.goal.map(|goal| (truth.translation.vector - nalgebra::Vector2::from(goal)).norm());
        if report.goal.is_some() {
            report.path_length_m = self.driven_at_fix_m.map(|at| simulator.driven_m() - at);
        }
        report.plans = pilot.plans();
        report.refixes = pilot.localizer().refixes();
        report.collisions = simulator.collisions();
        self.report
    }
}
