//! The replies to `nodes` and `match`.

use crate::model::geometry::{FixedPoint, Rect};
use crate::model::ids::MapName;
use crate::model::increment::NodeKind;
use serde::{Deserialize, Serialize};

/// One node as `nodes` and `match` show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NodeView {
    /// Its id as text.
    pub id: String,
    /// Main or support.
    pub kind: NodeKind,
    /// Metres in the map frame.
    pub x: f64,
    /// Metres in the map frame.
    pub y: f64,
    /// Radians.
    pub yaw: f64,
    /// Free space `[min_x, min_y, max_x, max_y]`, metres in the map frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_space: Option<[f64; 4]>,
    /// Ids of its neighbours.
    pub neighbours: Vec<String>,
    /// Cosine to the descriptor asked for (`match` only).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub similarity: Option<f32>,
    /// Trust in the node, 0 to 100; absent while it is 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trust: Option<u8>,
}

impl NodeView {
    /// The corners `[min_x, min_y, max_x, max_y]` of a node's rectangle.
    #[must_use]
    pub fn corners(node: FixedPoint, rect: &Rect) -> [f64; 4] {
        let (min, max) = (rect.min(node), rect.max(node));
        [min.0, min.1, max.0, max.1]
    }
}

/// The reply to `nodes`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct NodesReply {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// Nearest first.
    pub nodes: Vec<NodeView>,
}
