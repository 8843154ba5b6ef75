//! The actions of Nav2 that a map service takes part in, as in Jazzy and Kilted.

use crate::interface::RosAction;
use crate::msg::{HeaderMsg, PathMsg, PoseStamped, Time, Vector3};
use serde::{Deserialize, Serialize};

/// `nav2_msgs/action/NavigateToPose`.
pub struct NavigateToPose;

/// Where to drive.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct NavigateToPoseGoal {
    pub pose: PoseStamped,
    /// A behaviour tree's file; empty: the usual one.
    pub behavior_tree: String,
}

/// What came of it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NavigateToPoseResult {
    /// 0: none.
    pub error_code: u16,
    /// The reason in words.
    pub error_msg: String,
}

/// How it goes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NavigateToPoseFeedback {
    /// Where the robot is.
    pub current_pose: PoseStamped,
    /// Time since the goal was accepted.
    pub navigation_time: Time,
    /// Time that is left, estimated.
    pub estimated_time_remaining: Time,
    /// How often the robot had to free itself.
    pub number_of_recoveries: i16,
    /// Metres that are left.
    pub distance_remaining: f32,
}

impl RosAction for NavigateToPose {
    const TYPE: &'static str = "nav2_msgs/action/NavigateToPose";
    type Goal = NavigateToPoseGoal;
    type Result = NavigateToPoseResult;
    type Feedback = NavigateToPoseFeedback;
}

/// `nav2_msgs/action/ComputePathToPose`.
pub struct ComputePathToPose;

/// From where to where.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComputePathToPoseGoal {
    /// The end of the path.
    pub goal: PoseStamped,
    /// Its start, if `use_start`.
    pub start: PoseStamped,
    /// Which planner; empty: the usual one.
    pub planner_id: String,
    /// Whether the path starts at `start`; otherwise where the robot is.
    pub use_start: bool,
}

/// The path.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComputePathToPoseResult {
    /// Empty if there is none.
    pub path: PathMsg,
    /// How long it took.
    pub planning_time: Time,
    /// 0: none.
    pub error_code: u16,
    /// The reason in words.
    pub error_msg: String,
}

/// Nothing; ROS writes one byte for a message without fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct ComputePathToPoseFeedback {
    pub structure_needs_at_least_one_member: u8,
}

impl RosAction for ComputePathToPose {
    const TYPE: &'static str = "nav2_msgs/action/ComputePathToPose";
    type Goal = ComputePathToPoseGoal;
    type Result = ComputePathToPoseResult;
    type Feedback = ComputePathToPoseFeedback;
}

/// `nav2_msgs/action/ComputeRoute`.
pub struct ComputeRoute;

/// From where to where, by poses or by the ids of nodes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComputeRouteGoal {
    /// The first node, unless `use_poses`.
    pub start_id: u16,
    /// The start, if `use_poses` and `use_start`.
    pub start: PoseStamped,
    /// The last node, unless `use_poses`.
    pub goal_id: u16,
    /// The end, if `use_poses`.
    pub goal: PoseStamped,
    /// Whether the route starts at `start`; otherwise where the robot is.
    pub use_start: bool,
    /// Whether poses count, and not ids.
    pub use_poses: bool,
}

/// `nav2_msgs/RouteNode`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct RouteNodeMsg {
    pub nodeid: u16,
    pub position: Vector3,
}

/// `nav2_msgs/RouteEdge`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct RouteEdgeMsg {
    pub edgeid: u16,
    pub start: Vector3,
    pub end: Vector3,
}

/// `nav2_msgs/Route`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RouteMsg {
    /// Stamp and the frame of the positions.
    pub header: HeaderMsg,
    /// What it costs: metres.
    pub route_cost: f32,
    /// In their order.
    pub nodes: Vec<RouteNodeMsg>,
    /// Those between them, in their order.
    pub edges: Vec<RouteEdgeMsg>,
}

/// The route. Jazzy's has no `error_msg`: it stands behind all that readers there know, and they
/// pass over it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComputeRouteResult {
    /// How long it took.
    pub planning_time: Time,
    /// The same as a dense path.
    pub path: PathMsg,
    /// Empty if there is none.
    pub route: RouteMsg,
    /// 0: none.
    pub error_code: u16,
    /// The reason in words.
    pub error_msg: String,
}

/// Nothing; ROS writes one byte for a message without fields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct ComputeRouteFeedback {
    pub structure_needs_at_least_one_member: u8,
}

impl RosAction for ComputeRoute {
    const TYPE: &'static str = "nav2_msgs/action/ComputeRoute";
    type Goal = ComputeRouteGoal;
    type Result = ComputeRouteResult;
    type Feedback = ComputeRouteFeedback;
}
