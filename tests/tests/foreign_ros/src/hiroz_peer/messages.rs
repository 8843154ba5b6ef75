//! The messages, as their definitions have them. hiroz computes the hashes of topics' types from
//! these; those of actions it is told.

use hiroz::MessageTypeInfo;
use hiroz::action::ZAction;
use hiroz::entity::{TypeHash, TypeInfo};
use hiroz::msg::{SerdeCdrSerdes, ZMessage};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Type hashes by names such as `nav2_msgs/action/NavigateToPose_SendGoal`.
pub static HASHES: OnceLock<BTreeMap<String, String>> = OnceLock::new();

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "builtin_interfaces/msg/Time")]
pub struct Time {
    pub sec: i32,
    pub nanosec: u32,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "std_msgs/msg/Header")]
pub struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "geometry_msgs/msg/Vector3")]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "geometry_msgs/msg/Quaternion")]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "geometry_msgs/msg/Transform")]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "geometry_msgs/msg/TransformStamped")]
pub struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub transform: Transform,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "tf2_msgs/msg/TFMessage")]
pub struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "geometry_msgs/msg/Twist")]
pub struct Twist {
    pub linear: Vector3,
    pub angular: Vector3,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize, MessageTypeInfo)]
#[ros_msg(type_name = "geometry_msgs/msg/TwistStamped")]
pub struct TwistStamped {
    pub header: Header,
    pub twist: Twist,
}

/// Poses have a point and no vector; their numbers are the same.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Pose {
    pub position: Vector3,
    pub orientation: Quaternion,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PoseStamped {
    pub header: Header,
    pub pose: Pose,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Path {
    pub header: Header,
    pub poses: Vec<PoseStamped>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RouteNode {
    pub nodeid: u16,
    pub position: Vector3,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RouteEdge {
    pub edgeid: u16,
    pub start: Vector3,
    pub end: Vector3,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Route {
    pub header: Header,
    pub route_cost: f32,
    pub nodes: Vec<RouteNode>,
    pub edges: Vec<RouteEdge>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PathGoal {
    pub goal: PoseStamped,
    pub start: PoseStamped,
    pub planner_id: String,
    pub use_start: bool,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PathResult {
    pub path: Path,
    pub planning_time: Time,
    pub error_code: u16,
    pub error_msg: String,
}

/// ROS writes one byte for a message without fields.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct PathFeedback {
    pub structure_needs_at_least_one_member: u8,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RouteGoal {
    pub start_id: u16,
    pub start: PoseStamped,
    pub goal_id: u16,
    pub goal: PoseStamped,
    pub use_start: bool,
    pub use_poses: bool,
}

/// As in Jazzy: without `error_msg`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RouteResult {
    pub planning_time: Time,
    pub path: Path,
    pub route: Route,
    pub error_code: u16,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct RouteFeedback {
    pub structure_needs_at_least_one_member: u8,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct NavigateGoal {
    pub pose: PoseStamped,
    pub behavior_tree: String,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct NavigateResult {
    pub error_code: u16,
    pub error_msg: String,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct NavigateFeedback {
    pub current_pose: PoseStamped,
    pub navigation_time: Time,
    pub estimated_time_remaining: Time,
    pub number_of_recoveries: i16,
    pub distance_remaining: f32,
}

macro_rules! messages {
    ($($message:ty),* $(,)?) => {
        $(impl ZMessage for $message {
            type Serdes = SerdeCdrSerdes<$message>;
        })*
    };
}

messages!(
    TfMessage,
    TwistStamped,
    PathGoal,
    PathResult,
    PathFeedback,
    RouteGoal,
    RouteResult,
    RouteFeedback,
    NavigateGoal,
    NavigateResult,
    NavigateFeedback,
);

/// A type by its name as in `nav2_msgs/action/NavigateToPose_SendGoal`.
fn type_info(name: &str) -> TypeInfo {
    let hash = HASHES.get().and_then(|hashes| hashes.get(name)).and_then(|hash| TypeHash::from_rihs_string(hash));
    let parts: Vec<&str> = name.split('/').collect();
    let dds = format!("{}::{}::dds_::{}_", parts[0], parts[1], parts[2]);
    TypeInfo::new(&dds, hash.unwrap_or_else(|| panic!("no hash of {name}")))
}

macro_rules! action {
    ($action:ident, $name:literal, $goal:ty, $result:ty, $feedback:ty) => {
        pub struct $action;

        impl ZAction for $action {
            type Goal = $goal;
            type Result = $result;
            type Feedback = $feedback;

            fn name() -> &'static str {
                $name
            }

            fn send_goal_type_info() -> TypeInfo {
                type_info(concat!($name, "_SendGoal"))
            }

            fn get_result_type_info() -> TypeInfo {
                type_info(concat!($name, "_GetResult"))
            }

            fn cancel_goal_type_info() -> TypeInfo {
                type_info("action_msgs/srv/CancelGoal")
            }

            fn feedback_type_info() -> TypeInfo {
                type_info(concat!($name, "_FeedbackMessage"))
            }

            fn status_type_info() -> TypeInfo {
                type_info("action_msgs/msg/GoalStatusArray")
            }
        }
    };
}

action!(ComputePath, "nav2_msgs/action/ComputePathToPose", PathGoal, PathResult, PathFeedback);
action!(ComputeRoute, "nav2_msgs/action/ComputeRoute", RouteGoal, RouteResult, RouteFeedback);
action!(Navigate, "nav2_msgs/action/NavigateToPose", NavigateGoal, NavigateResult, NavigateFeedback);
