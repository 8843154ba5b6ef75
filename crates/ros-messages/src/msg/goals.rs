//! Goals of actions: their names, their states, and how they are cancelled.

use super::Time;
use crate::interface::RosService;
use serde::{Deserialize, Serialize};

/// `unique_identifier_msgs/UUID`: the name of a goal, chosen by who sends it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct GoalUuid {
    pub uuid: [u8; 16],
}

/// `action_msgs/GoalInfo`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalInfo {
    /// The goal's name.
    pub goal_id: GoalUuid,
    /// When the server accepted it.
    pub stamp: Time,
}

/// `action_msgs/GoalStatus`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalStatusMsg {
    /// The goal.
    pub goal_info: GoalInfo,
    /// Its state: [`Self::ACCEPTED`] to [`Self::ABORTED`].
    pub status: i8,
}

impl GoalStatusMsg {
    /// Nothing is known of the goal.
    pub const UNKNOWN: i8 = 0;
    /// Accepted, not begun.
    pub const ACCEPTED: i8 = 1;
    /// Under way.
    pub const EXECUTING: i8 = 2;
    /// Asked to end early.
    pub const CANCELING: i8 = 3;
    /// Ended: reached.
    pub const SUCCEEDED: i8 = 4;
    /// Ended: cancelled.
    pub const CANCELED: i8 = 5;
    /// Ended: failed.
    pub const ABORTED: i8 = 6;
}

/// `action_msgs/GoalStatusArray`: the states of all goals that a server knows.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct GoalStatusArray {
    pub status_list: Vec<GoalStatusMsg>,
}

/// `action_msgs/srv/CancelGoal`.
pub struct CancelGoal;

/// Which goals are to end: one by its name; with a name of zeros all that were accepted before the
/// stamp; with both zero all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct CancelGoalRequest {
    pub goal_info: GoalInfo,
}

/// What became of it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CancelGoalResponse {
    /// 0: none or some goals will end; 1: refused; 2: no such goal; 3: the goal has ended.
    pub return_code: i8,
    /// The goals that will end.
    pub goals_canceling: Vec<GoalInfo>,
}

impl CancelGoalResponse {
    /// `return_code` of a request for a goal that nobody knows.
    pub const UNKNOWN_GOAL: i8 = 2;
    /// `return_code` of a request for a goal that has ended.
    pub const TERMINATED: i8 = 3;
}

impl RosService for CancelGoal {
    const TYPE: &'static str = "action_msgs/srv/CancelGoal";
    type Request = CancelGoalRequest;
    type Response = CancelGoalResponse;
}
