//! What happened in a mission, as figures. The truth comes from the simulator and is used for
//! nothing else.

use super::arguments::RobotArgs;
use super::error::CliError;
use fht_bag::WriteError;
use fht_client::Planner;
use fht_program::print_line;
use serde::Serialize;

/// The outcome of a mission in a simulated world.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MissionReport {
    /// The robot's name.
    pub robot: String,
    /// The map used.
    pub map: String,
    /// Where it truly started, map frame: `[x, y, yaw]`, metres and radians.
    pub start: [f64; 3],
    /// Where it was to go, map frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 2]>,
    /// The heading that it was to have there, map frame, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_yaw: Option<f64>,
    /// How far from the goal the nearest point is that the robot drove to instead, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_moved_m: Option<f64>,
    /// Whether it declared to know where it is at all.
    pub localized: bool,
    /// Whether it knew at the end.
    pub localized_at_end: bool,
    /// Distance driven until the first fix, metres.
    pub relocalization_distance_m: Option<f64>,
    /// Error of the first fix when it was declared, metres.
    pub relocalization_error_m: Option<f64>,
    /// Error of its heading, degrees.
    pub relocalization_error_deg: Option<f64>,
    /// Estimations that the first fix rested on, and how many were made.
    pub relocalization_evidence: Option<[usize; 2]>,
    /// Greatest error while it claimed to know, metres.
    pub worst_error_m: Option<f64>,
    /// Error at the end, metres.
    pub final_error_m: Option<f64>,
    /// Error of the heading at the end, degrees.
    pub final_error_deg: Option<f64>,
    /// Whether it arrived: it says so, and it is truly at the goal
    /// ([`AT_GOAL_M`](super::AT_GOAL_M), [`AT_GOAL_DEG`](super::AT_GOAL_DEG)).
    pub arrived: bool,
    /// True distance at the end to the goal, or to the point that it drove to instead, metres.
    pub goal_distance_m: Option<f64>,
    /// True angle to the goal's heading at the end, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goal_turn_deg: Option<f64>,
    /// Why it failed, if it did: the robot's own reason, or that it is not where it believes to be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub failure: Option<String>,
    /// Truly driven from the fix to the end, metres.
    pub path_length_m: Option<f64>,
    /// Shortest possible for the robot from where it truly was at the fix to the goal, metres.
    pub shortest_length_m: Option<f64>,
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
    /// Simulated time, seconds.
    pub sim_s: f64,
    /// Time on the clock, seconds.
    pub wall_s: f64,
    /// How often the robot's body touched a wall or a thing.
    pub collisions: u64,
    /// How often people and the robot touched, if there were people.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contacts: Option<fht_sim::Contacts>,
    /// How often other robots of a shared world and this one touched, if there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot_contacts: Option<fht_sim::RobotContacts>,
    /// Where the robot thought it was after the fix, map frame, twice a second: `[x, y]`.
    pub trajectory: Vec<[f64; 2]>,
    /// Where it truly was all along, map frame, twice a second: `[x, y]`.
    pub true_trajectory: Vec<[f64; 2]>,
}

impl MissionReport {
    /// To the millimetre, the millisecond and 1e-4 rad: what is behind that is noise of the
    /// arithmetic.
    pub(super) fn rounded(mut self) -> Self {
        let thousandths = |value: f64| (value * 1e3).round() / 1e3;
        let yaw = |value: f64| (value * 1e4).round() / 1e4;
        let [x, y, heading] = self.start;
        self.start = [thousandths(x), thousandths(y), yaw(heading)];
        self.goal_yaw = self.goal_yaw.map(yaw);
        for figure in [
            &mut self.relocalization_distance_m,
            &mut self.relocalization_error_m,
            &mut self.relocalization_error_deg,
            &mut self.worst_error_m,
            &mut self.final_error_m,
            &mut self.final_error_deg,
            &mut self.goal_distance_m,
            &mut self.goal_moved_m,
            &mut self.goal_turn_deg,
            &mut self.path_length_m,
            &mut self.shortest_length_m,
            &mut self.planned_length_m,
        ] {
            *figure = figure.map(thousandths);
        }
        (self.sim_s, self.wall_s) = (thousandths(self.sim_s), thousandths(self.wall_s));
        for point in self.goal.iter_mut().chain(&mut self.trajectory).chain(&mut self.true_trajectory) {
            *point = point.map(thousandths);
        }
        self
    }
}

/// Prints the figures in words.
/// Tells the figures of a mission, why it failed, and what of its recording is not there.
pub(super) fn tell<R: Serialize>(
    args: &RobotArgs,
    report: &R,
    print: impl FnOnce(&R),
    failure: Option<&str>,
    recorded: Result<(), WriteError>,
) -> Result<(), CliError> {
    let in_words = |report: &R| {
        if !args.quiet {
            print(report);
        }
    };
    args.report.give(report, in_words).map_err(CliError::Report)?;
    if let Some(failure) = failure {
        fht_program::tell_line!("client-robot: failed: {failure}");
    }
    Ok(recorded?)
}

pub(super) fn print_report(report: &MissionReport) {
    match (report.relocalization_distance_m, report.relocalization_error_m, report.relocalization_error_deg) {
        (Some(driven), Some(metres), Some(degrees)) => {
            print_line!("localized after {driven:.1} m, error {metres:.3} m and {degrees:.2} degrees");
        }
        _ => print_line!("not localized"),
    }
    if let Some(moved_m) = report.goal_moved_m {
        print_line!("the goal cannot be reached: it drove to the nearest point that can, {moved_m:.2} m from it");
    }
    if report.arrived
        && let (Some(driven), Some(left)) = (report.path_length_m, report.goal_distance_m)
    {
        let shortest = report.shortest_length_m.map(|m| format!(" (shortest {m:.1} m)")).unwrap_or_default();
        let turn = report.goal_turn_deg.map(|degrees| format!(" and {degrees:.1} degrees")).unwrap_or_default();
        print_line!("arrived after {driven:.1} m{shortest}, {left:.2} m{turn} from the goal");
    }
    if report.planner == Some(Planner::Replica) {
        print_line!("the server was silent: the path was planned on the robot's own copy of the map");
    }
}
