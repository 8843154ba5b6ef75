//! The reply to `path`.

use crate::model::ids::MapName;
use serde::{Deserialize, Serialize};

/// A point of a path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Waypoint {
    /// Metres in the map frame.
    pub x: f64,
    /// Metres in the map frame.
    pub y: f64,
    /// The node passed, none at the start and at the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
}

/// What a path obeys.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "rule", rename_all = "snake_case")]
pub enum Obeyed {
    /// A zone that no robot may enter.
    KeepOut {
        /// Its name.
        zone: String,
    },
    /// An edge that an operator has closed.
    ClosedEdge {
        /// Its ends.
        edge: [String; 2],
    },
    /// Something that a robot found blocked.
    Blocked {
        /// The robot.
        robot: String,
    },
}

/// A part of a path where robots drive slowly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SpeedLimit {
    /// The zone's name.
    pub zone: String,
    /// Metres per second.
    pub max_mps: f64,
    /// Where the path enters and leaves it, metres along the path.
    pub along_m: [f64; 2],
}

fn is_zero(metres: &f64) -> bool {
    *metres == 0.0
}

/// The reply to `path`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PathReply {
    /// The map.
    pub map: MapName,
    /// The version that the path was planned on.
    pub version: u64,
    /// The release that it was planned on, as `name@author`; none: the newest state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub release: Option<String>,
    /// Its length over all waypoints, metres.
    pub length_m: f64,
    /// From start to goal.
    pub waypoints: Vec<Waypoint>,
    /// How far the last waypoint is from the goal that was asked for, metres. Absent when it is the
    /// goal: only `to_nearest=true` moves it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub goal_moved_m: f64,
    /// How much of the path leads over ground that the map knows nothing of, metres: no rectangle
    /// covers it and no main node's scan saw it. Absent when there is none. Such ground is at the
    /// start or at the goal.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub unmapped_m: f64,
    /// The heading at the goal, radians; there if the goal is a named place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal_yaw: Option<f64>,
    /// What operators and robots have closed, and the path keeps out of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obeyed: Vec<Obeyed>,
    /// Zones of limited speed that it leads through, in the order in which they are entered.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub speed_limits: Vec<SpeedLimit>,
}
