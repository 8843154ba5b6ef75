//! Where a robot that serves is sent, and what becomes of it.

use crate::api::reply::{ErrorCode, PlaceRef};
use crate::model::geometry::FixedPose;
use serde::{Deserialize, Serialize};

/// A robot is to drive somewhere: what an operator asks of its `goal` key, or puts there
/// ([`parse_goal`](crate::api::request::parse_goal)).
#[derive(Clone, Debug, PartialEq)]
pub struct GoalOrder {
    /// The sender's name for it: 1 to 64 of `a-z A-Z 0-9 _ -`. Said twice, it is one goal.
    pub id: String,
    /// Where to. At a named place the robot turns to the place's heading.
    pub to: PlaceRef,
    /// The heading at coordinates, map frame, radians; none: the robot stays as it came.
    pub yaw: Option<f64>,
    /// Whether the robot may drive to the nearest point that it can reach, if it cannot reach the
    /// goal.
    pub to_nearest: bool,
}

impl GoalOrder {
    /// Longest message that is read, bytes.
    pub const MAX_BYTES: usize = 4096;
    /// Greatest heading, either way, radians: a turn, to the next 1e-4.
    pub const MAX_YAW_RAD: f64 = FixedPose::MAX_YAW_RAD;
}

/// How far a robot is with a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum GoalState {
    /// The robot was sent nowhere yet.
    Idle,
    /// It is the next one.
    Waiting,
    /// The robot drives there.
    Driving,
    /// The robot is there.
    Arrived,
    /// The robot could not get there.
    Failed,
    /// An operator took it back or sent another one in its place, or the robot ended.
    Cancelled,
}

impl GoalState {
    /// Whether nothing more becomes of the goal.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Arrived | Self::Failed | Self::Cancelled)
    }
}

impl std::fmt::Display for GoalState {
    /// As it is written in JSON.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Idle => "IDLE",
            Self::Waiting => "WAITING",
            Self::Driving => "DRIVING",
            Self::Arrived => "ARRIVED",
            Self::Failed => "FAILED",
            Self::Cancelled => "CANCELLED",
        })
    }
}

/// What a robot that serves puts under its `goal/status` key, and replies when it is sent or asked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct GoalStatus {
    /// The robot's name.
    pub robot: String,
    /// How far it is.
    pub state: GoalState,
    /// The goal's id; absent while the robot was sent nowhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// Where the goal is, `[x, y]` in the map frame, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 2]>,
    /// The heading there, map frame, radians; absent if the robot stays as it comes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_yaw: Option<f64>,
    /// How far from the goal the path ends, metres, if it leads to the nearest point that can be
    /// reached.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_moved_m: Option<f64>,
    /// What is left of the path, metres, while the robot drives.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_go_m: Option<f64>,
    /// Why it failed, for programs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<ErrorCode>,
    /// Why it failed or was cancelled: one sentence for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The id of the goal that is next.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waiting: Option<String>,
    /// When that was, by the robot's clock: microseconds since 1970. Absent if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stamp_us: Option<u64>,
}

impl GoalStatus {
    /// Of a robot that was sent nowhere yet.
    #[must_use]
    pub fn idle(robot: &str) -> Self {
        Self {
            robot: robot.to_owned(),
            state: GoalState::Idle,
            id: None,
            goal: None,
            goal_yaw: None,
            goal_moved_m: None,
            to_go_m: None,
            code: None,
            reason: None,
            waiting: None,
            stamp_us: None,
        }
    }
}
