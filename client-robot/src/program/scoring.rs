//! A mission in a simulated world, scored against the truth.

use super::report::MissionReport;
use crate::mission::{MissionObserver, MissionOutcome};
use crate::pilot::{DriveGoal, Pilot, PilotStep, TaskOutcome};
use fht_client::Planner;
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use fht_program::flags::with_flags;
use fht_sim::Simulator;
use fht_sim::scoring::pose_error;
use fht_sim::{Truth, World};
use nalgebra::Vector2;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A robot is at its goal if it truly is less far from it, metres. Its own tolerance is at most
/// [`PilotConfig::goal_slack_m`](crate::pilot::PilotConfig::goal_slack_m); the rest is its error.
pub const AT_GOAL_M: f64 = 0.5;
/// It has the goal's heading if it truly is less far from it, degrees.
pub const AT_GOAL_DEG: f64 = 5.0;
/// A robot that knows where it is is less far from there, metres and degrees: the paper's test of
/// success.
const KNOWS_PLACE: (f64, f64) = (1.0, 5.0);
/// Frames between points of the trajectories: 0.6 s.
const TRAJECTORY_EVERY: usize = 3;

/// Collects the figures of a mission: give it to [`run`](crate::mission::run) as the observer.
pub struct MissionScore {
    truth: Truth,
    world: Arc<World>,
    radius_m: f64,
    map_from_world: Pose2,
    report: MissionReport,
    frames: usize,
    /// Whether another robot was there at some time.
    met_robots: bool,
    driven_at_fix_m: Option<f64>,
    first_us: Option<u64>,
    /// Where the robot drives to instead of the goal.
    instead: Option<Point2>,
    /// The estimate and the truth at the newest frame, while the robot knows its place.
    last: Option<(Pose2, Pose2)>,
}

impl MissionScore {
    /// The score of `simulator`'s robot, which stands at its start. `world_from_map` is where the
    /// map's frame truly lies.
    #[must_use]
    pub fn new(simulator: &Simulator, world_from_map: &Pose2) -> Self {
        let (truth, map_from_world) = (simulator.watch_truth(), world_from_map.inverse());
        let start = map_from_world * truth.world_from_base();
        let start = [start.translation.x, start.translation.y, start.rotation.angle()];
        Self {
            truth,
            world: Arc::clone(simulator.world()),
            radius_m: simulator.config().radius_m,
            map_from_world,
            report: MissionReport { start, ..MissionReport::default() },
            frames: 0,
            met_robots: false,
            driven_at_fix_m: None,
            first_us: None,
            instead: None,
            last: None,
        }
    }

    /// The figures of a mission that has ended.
    #[must_use]
    pub fn finish(mut self, outcome: &MissionOutcome) -> MissionReport {
        let report = &mut self.report;
        if let Some((metres, degrees)) = self.last.map(|(estimate, truth)| pose_error(&estimate, &truth)) {
            report.final_error_m = Some(metres);
            report.final_error_deg = Some(degrees);
        }
        let truth = self.map_from_world * self.truth.world_from_base();
        let goal = self.instead.map(|point| point.coords).or(report.goal.map(Vector2::from));
        report.goal_distance_m = goal.map(|goal| (truth.translation.vector - goal).norm());
        // It stays as it came.
        report.goal_yaw = report.goal_yaw.filter(|_| self.instead.is_none());
        report.goal_turn_deg = report.goal_yaw.map(|yaw| wrap_angle(yaw - truth.rotation.angle()).abs().to_degrees());
        report.failure = failure(report, &outcome.task);
        report.arrived = outcome.task == TaskOutcome::Arrived && report.failure.is_none();
        if report.goal.is_some() {
            report.path_length_m = self.driven_at_fix_m.map(|at| self.truth.driven_m() - at);
        }
        report.plans = outcome.plans;
        report.refixes = outcome.refixes;
        report.collisions = self.truth.collisions();
        report.robot_contacts = self.met_robots.then(|| self.truth.robot_contacts());
        report.contacts = (!self.truth.people().is_empty()).then(|| self.truth.contacts());
        self.report
    }

    fn score_estimate(&mut self, step: &PilotStep, truth: &Pose2, is_drawn: bool) {
        let report = &mut self.report;
        let estimate = step.localization.map_from_base();
        report.localized_at_end = estimate.is_some();
        self.last = estimate.map(|estimate| (estimate, *truth));
        let Some(estimate) = estimate else { return };
        let (metres, degrees) = pose_error(&estimate, truth);
        report.worst_error_m = Some(report.worst_error_m.map_or(metres, |worst| worst.max(metres)));
        if !report.localized {
            let driven_m = self.truth.driven_m();
            report.localized = true;
            report.relocalization_distance_m = Some(driven_m);
            report.relocalization_error_m = Some(metres);
            report.relocalization_error_deg = Some(degrees);
            report.relocalization_evidence = step.localization.evidence;
            self.driven_at_fix_m = Some(driven_m);
        }
        if is_drawn {
            report.trajectory.push([estimate.translation.x, estimate.translation.y]);
        }
    }
}

/// Why the task is not done: what the robot says, or else what the truth does.
fn failure(report: &MissionReport, task: &TaskOutcome) -> Option<String> {
    /// What may be wrong instead.
    const HINT: &str = "(where the map does not begin at the world's own start, --map-origin says where it does)";
    match task {
        TaskOutcome::Failed(failure) => Some(with_flags(&failure.to_string())),
        TaskOutcome::Localized => {
            let (metres, degrees) = report.final_error_m.zip(report.final_error_deg)?;
            let is_right = metres < KNOWS_PLACE.0 && degrees < KNOWS_PLACE.1;
            (!is_right).then(|| {
                format!("the robot says that it knows its place, but it is {metres:.2} m and {degrees:.1} degrees off {HINT}")
            })
        }
        TaskOutcome::Arrived => {
            let left_m = report.goal_distance_m?;
            if left_m >= AT_GOAL_M {
                return Some(format!(
                    "the robot says that it arrived, but it stands {left_m:.2} m from the goal {HINT}"
                ));
            }
            let off = report.goal_turn_deg.filter(|degrees| *degrees >= AT_GOAL_DEG)?;
            Some(format!("the robot says that it arrived, but it is turned {off:.1} degrees from the goal's heading"))
        }
    }
}

impl MissionObserver for MissionScore {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()> {
        let truth = self.map_from_world * self.truth.world_from_base();
        let is_drawn = self.frames.is_multiple_of(TRAJECTORY_EVERY);
        self.frames += 1;
        self.met_robots |= !self.truth.robots().is_empty();
        let report = &mut self.report;
        let first = *self.first_us.get_or_insert(frame.time_us);
        report.sim_s = frame.time_us.saturating_sub(first) as f64 / 1e6;
        if is_drawn {
            report.true_trajectory.push([truth.translation.x, truth.translation.y]);
        }
        if let Some(path) = pilot.path() {
            report.planned_length_m.get_or_insert(path.length_m);
            let end = path.points.last().filter(|_| path.goal_moved_m > 0.0);
            self.instead = end.map(|end| end.position);
            report.goal_moved_m = end.map(|_| path.goal_moved_m);
            // The robot plans first and the server answers after: its word is the better.
            if report.planner != Some(Planner::Server) {
                report.planner = Some(path.planner);
            }
        }
        self.score_estimate(step, &truth, is_drawn);
        ControlFlow::Continue(())
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        self.report.goal_yaw = goal.yaw;
        let goal = goal.position;
        self.report.goal = Some([goal.x, goal.y]);
        let from = Point2::from(self.truth.world_from_base().translation.vector);
        let to = self.map_from_world.inverse() * goal;
        let shortest = self.world.plan().shortest_path(from, to, self.radius_m);
        self.report.shortest_length_m =
            shortest.map(|points| points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum());
    }
}
