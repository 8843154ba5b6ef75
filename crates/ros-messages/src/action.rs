//! What ROS makes of an action: three services and two topics.

use crate::msg::{GoalUuid, Time};
use serde::{Deserialize, Serialize};

/// `X_SendGoal_Request`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalRequest<G> {
    /// The goal's name.
    pub goal_id: GoalUuid,
    /// The goal.
    pub goal: G,
}

/// `X_SendGoal_Response`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// Whether the server takes it.
    pub accepted: bool,
    /// When it did.
    pub stamp: Time,
}

/// `X_GetResult_Request`: answered when the goal has ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetResultRequest {
    /// The goal's name.
    pub goal_id: GoalUuid,
}

/// `X_GetResult_Response`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultResponse<R> {
    /// How the goal ended: a constant of [`GoalStatusMsg`](crate::msg::GoalStatusMsg).
    pub status: i8,
    /// What came of it.
    pub result: R,
}

/// `X_FeedbackMessage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackMessage<F> {
    /// The goal's name.
    pub goal_id: GoalUuid,
    /// How it goes.
    pub feedback: F,
}
