//! What happened in a mission with a ROS robot, as the robot itself knows it.

use crate::mission::{MissionObserver, MissionOutcome};
use crate::pilot::{DriveGoal, Pilot, PilotStep, TaskOutcome};
use fht_client::Planner;
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Point2, Pose2};
use fht_program::flags::with_flags;
use fht_program::print_line;
use fht_ros_robot::IntakeReport;
use serde::Serialize;
use std::ops::ControlFlow;

/// The outcome of a mission with a ROS robot. Distances are the odometry's, places the robot's own
/// word.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RosMissionReport {
    /// The robot's name.
    pub robot: String,
    /// The map used.
    pub map: String,
    /// What became of the sensors' messages.
    #[serde(flatten)]
    pub intake: IntakeReport,
    /// Whether it declared to know where it is at all.
    pub localized: bool,
    /// Whether it knew at the end.
    pub localized_at_end: bool,
    /// Distance driven until the first fix, metres.
    pub relocalization_distance_m: Option<f64>,
    /// Estimations that the first fix rested on, and how many were made.
    pub relocalization_evidence: Option<[usize; 2]>,
    /// Where it was to go, map frame, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 2]>,
    /// The heading that it was to have there, map frame, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_yaw: Option<f64>,
    /// How far from the goal the nearest point is that the robot drove to instead, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_moved_m: Option<f64>,
    /// Whether it says that it arrived.
    pub arrived: bool,
    /// Where it is at the end, map frame: `[x, y, yaw]`, metres and radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end: Option<[f64; 3]>,
    /// Why it failed, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Driven from the fix to the end, metres.
    pub path_length_m: Option<f64>,
    /// Length of the first path planned, metres.
    pub planned_length_m: Option<f64>,
    /// Who planned: the server, if it ever gave a path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planner: Option<Planner>,
    /// How often a path was asked for.
    pub plans: usize,
    /// How often the server was silent, or answered with what is no path, and the robot kept to its
    /// own.
    pub fallbacks: usize,
    /// How often a fix was replaced by another place.
    pub refixes: usize,
    /// Time of the robot's clock from the first frame to the last, seconds.
    pub robot_s: f64,
    /// Time on the clock, seconds.
    pub wall_s: f64,
}

/// Collects the figures.
#[derive(Default)]
pub(super) struct RosMissionScore {
    report: RosMissionReport,
    first_us: Option<u64>,
    driven_m: f64,
    driven_at_fix_m: Option<f64>,
    last: Option<Pose2>,
}

impl RosMissionScore {
    pub(super) fn finish(self, outcome: &MissionOutcome) -> RosMissionReport {
        let failure = match &outcome.task {
            TaskOutcome::Failed(failure) => Some(with_flags(&failure.to_string())),
            TaskOutcome::Localized | TaskOutcome::Arrived => None,
        };
        RosMissionReport {
            arrived: outcome.task == TaskOutcome::Arrived,
            end: self.last.map(|at| [at.translation.x, at.translation.y, at.rotation.angle()]),
            failure,
            path_length_m: self.driven_at_fix_m.map(|at_fix_m| self.driven_m - at_fix_m),
            plans: outcome.plans,
            refixes: outcome.refixes,
            ..self.report
        }
    }
}

impl MissionObserver for RosMissionScore {
    fn on_frame(&mut self, frame: &SensorFrame, step: &PilotStep, pilot: &Pilot) -> ControlFlow<()> {
        let (report, localization) = (&mut self.report, &step.localization);
        let first_us = *self.first_us.get_or_insert(frame.time_us);
        report.robot_s = frame.time_us.saturating_sub(first_us) as f64 * 1e-6;
        self.driven_m = localization.odometry.odometer_m;
        self.last = localization.map_from_base();
        report.localized_at_end = self.last.is_some();
        if self.last.is_some() && !report.localized {
            report.localized = true;
            report.relocalization_distance_m = Some(self.driven_m);
            report.relocalization_evidence = localization.evidence;
            self.driven_at_fix_m = Some(self.driven_m);
        }
        if let Some(path) = pilot.path() {
            report.planned_length_m.get_or_insert(path.length_m);
            report.goal_moved_m = Some(path.goal_moved_m).filter(|moved_m| *moved_m > 0.0);
            // The robot plans first and the server answers after: its word is the better.
            if report.planner != Some(Planner::Server) {
                report.planner = Some(path.planner);
            }
        }
        ControlFlow::Continue(())
    }

    fn on_goal(&mut self, goal: DriveGoal) {
        let Point2 { coords, .. } = goal.position;
        (self.report.goal, self.report.goal_yaw) = (Some([coords.x, coords.y]), goal.yaw);
    }
}

pub(super) fn print_report(report: &RosMissionReport) {
    match report.relocalization_distance_m {
        Some(driven_m) => print_line!("localized after {driven_m:.1} m"),
        None => print_line!("not localized"),
    }
    if let Some(moved_m) = report.goal_moved_m {
        print_line!("the goal cannot be reached: it drove to the nearest point that can, {moved_m:.2} m from it");
    }
    if let (true, Some(driven_m)) = (report.arrived, report.path_length_m) {
        print_line!("arrived after {driven_m:.1} m");
    }
    if let Some([x, y, yaw]) = report.end {
        print_line!("at ({x:.2}, {y:.2}), {:.0} degrees", yaw.to_degrees());
    }
    let IntakeReport { frames, scans, frames_late, frames_lost, .. } = report.intake;
    print_line!("{frames} frames of {scans} scans, {frames_late} late, {frames_lost} lost");
    if report.planner == Some(Planner::Replica) {
        print_line!("the server was silent: the path was planned on the robot's own copy of the map");
    }
}
