//! What the robot is to do, and what comes of it.

use fht_client::PoseReport;
use fht_localization::localizer::Localization;
use fht_perception::candidate::PossiblePlace;
use fht_perception::frame::Twist;
use fht_perception::pose::{Point2, Pose2};
use fht_proto::api::reply::ErrorReply;

/// Where to drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveGoal {
    /// A point of the map frame, metres.
    pub position: Point2,
    /// The heading that the robot turns to there, map frame, radians; none: it stays as it came.
    pub yaw: Option<f64>,
    /// Whether the robot drives to the nearest point that it can reach, if it cannot reach the
    /// goal.
    pub to_nearest: bool,
}

impl From<Point2> for DriveGoal {
    fn from(position: Point2) -> Self {
        Self { position, yaw: None, to_nearest: false }
    }
}

impl From<Pose2> for DriveGoal {
    fn from(map_from_goal: Pose2) -> Self {
        let position = Point2::from(map_from_goal.translation.vector);
        Self { position, yaw: Some(map_from_goal.rotation.angle()), to_nearest: false }
    }
}

/// What the robot is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Task {
    /// Find out where it is.
    Relocalize,
    /// Then drive to a place.
    GoTo(DriveGoal),
    /// Stand there, and go on knowing the place: for as long as it takes. A robot that was carried
    /// off moves about until it knows again.
    Stay,
}

/// Why a task failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The place was not found on the way allowed.
    #[error("not localized after {driven_m:.0} m")]
    NotLocalized {
        /// Distance driven while searching, metres.
        driven_m: f64,
    },
    /// The planner refused.
    #[error("{}", no_path(.0))]
    NoPath(ErrorReply),
    /// Something stands on the goal.
    #[error("the goal is blocked; {left_m:.2} m are left")]
    GoalBlocked {
        /// Distance to the goal, metres.
        left_m: f64,
    },
    /// The robot drives and comes no nearer.
    #[error("the goal cannot be reached: the robot came no nearer than {left_m:.2} m in {seconds:.0} s")]
    NoProgress {
        /// Left of the path where the robot was nearest, metres.
        left_m: f64,
        /// Time since then, seconds.
        seconds: f64,
    },
    /// Everything that was tried is blocked.
    #[error("the goal cannot be reached: {ways} times the way to it was blocked, and the robot is no nearer")]
    WaysBlocked {
        /// How often.
        ways: u32,
    },
    /// It stands at the goal and does not get round.
    #[error("at the goal the robot did not turn to its heading; {left_deg:.0}° are left")]
    NotTurned {
        /// Angle to the heading, degrees.
        left_deg: f64,
    },
    /// The goal was one of another map.
    #[error("another map has come to the name of the one that the goal was on")]
    MapReplaced,
    /// The time is up.
    #[error("out of time after {}", told_s(*seconds))]
    Timeout {
        /// Time since the start, seconds.
        seconds: f64,
    },
}

/// A planner's words, some of which begin with these.
fn no_path(refusal: &ErrorReply) -> String {
    let words = &refusal.message;
    if words.starts_with("no path") { words.clone() } else { format!("no path: {words}") }
}

/// Seconds as they are told: with a tenth below ten.
fn told_s(seconds: f64) -> String {
    if seconds < 10.0 { format!("{seconds:.1} s") } else { format!("{seconds:.0} s") }
}

/// How a task ended.
#[derive(Clone, Debug, PartialEq)]
pub enum TaskOutcome {
    /// The place is known (the end of [`Task::Relocalize`]).
    Localized,
    /// The goal is reached.
    Arrived,
    /// It failed.
    Failed(Failure),
}

/// What one frame led to.
#[derive(Clone, Debug)]
pub struct PilotStep {
    /// The command until the next frame.
    pub command: Twist,
    /// Where the robot is, as far as it knows.
    pub localization: Localization,
    /// Where it may be while it does not know, likeliest first.
    pub candidates: Vec<PossiblePlace>,
    /// Set once the task has ended.
    pub outcome: Option<TaskOutcome>,
}

impl PilotStep {
    /// Where the robot is, as it tells others.
    #[must_use]
    pub fn pose_report(&self) -> PoseReport {
        let localization = &self.localization;
        PoseReport {
            state: localization.state,
            confidence: localization.confidence,
            candidates: self.candidates.clone(),
            map_from_base: localization.map_from_base(),
            lost_because: localization.lost.map(|reason| reason.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::api::reply::ErrorCode;

    #[test]
    fn failures_say_what_they_have_to_say_once() {
        let refused = |message: &str| Failure::NoPath(ErrorReply::new(ErrorCode::NoPath, message)).to_string();
        assert_eq!(
            refused("no path joins (0.00, 0.00) and (15.00, 4.00)"),
            "no path joins (0.00, 0.00) and (15.00, 4.00)"
        );
        assert_eq!(refused("(9.00, 9.00) is not on the map"), "no path: (9.00, 9.00) is not on the map");
    }

    #[test]
    fn short_times_are_told_with_a_tenth() {
        let after = |seconds: f64| Failure::Timeout { seconds }.to_string();
        assert_eq!((after(0.5).as_str(), after(60.2).as_str()), ("out of time after 0.5 s", "out of time after 60 s"));
    }
}
