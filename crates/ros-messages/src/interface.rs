//! What a message, a service and an action are, and what ROS makes of an action: three services and
//! two topics.

use crate::msg::{GoalUuid, Time};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// A message type.
pub trait RosMessage {
    /// Its ROS name, such as `sensor_msgs/msg/LaserScan`.
    const TYPE: &'static str;
}

/// A service type.
pub trait RosService {
    /// Its ROS name, such as `std_srvs/srv/SetBool`.
    const TYPE: &'static str;
    /// What is asked.
    type Request: Serialize + DeserializeOwned + Send;
    /// What is answered.
    type Response: Serialize + DeserializeOwned + Send;
}

/// An action type.
pub trait RosAction {
    /// Its ROS name, such as `nav2_msgs/action/NavigateToPose`.
    const TYPE: &'static str;
    /// What is to be reached.
    type Goal: Serialize + DeserializeOwned + Send;
    /// What came of it.
    type Result: Serialize + DeserializeOwned + Send + Clone + Default;
    /// How it goes.
    type Feedback: Serialize + DeserializeOwned + Send;
}

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
