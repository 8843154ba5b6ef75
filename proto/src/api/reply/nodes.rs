//! The replies to `nodes` and `match`.

use crate::api::reply::cursor::ParseCursorError;
use crate::model::geometry::{FixedPoint, Rect};
use crate::model::ids::{MapName, NodeId};
use crate::model::increment::NodeKind;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

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
        // In whole millimetres: differences of metres are not to the millimetre any more.
        let metres = |at_mm: i32, reach_mm: i64| (i64::from(at_mm) + reach_mm) as f64 / 1000.0;
        let [west, south, east, north] = [rect.west_mm, rect.south_mm, rect.east_mm, rect.north_mm].map(i64::from);
        [metres(node.x_mm, -west), metres(node.y_mm, -south), metres(node.x_mm, east), metres(node.y_mm, north)]
    }
}

/// Where a page of nodes begins: nodes are ordered by their distance from the place asked for, and
/// then by their ids. As text the square of the distance in millimetres, `_`, and the id; empty for
/// the first page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodesCursor {
    /// At the first node.
    First,
    /// Behind a node at this distance and of this id.
    Behind(u64, NodeId),
}

impl NodesCursor {
    /// How far two places are apart, square millimetres: exactly, so that no two nodes change
    /// places between pages.
    #[must_use]
    pub fn square_mm(a: FixedPoint, b: FixedPoint) -> u64 {
        let square = |a: i32, b: i32| u64::from(a.abs_diff(b)).pow(2);
        square(a.x_mm, b.x_mm).saturating_add(square(a.y_mm, b.y_mm))
    }

    /// Whether a node comes behind it.
    #[must_use]
    pub fn is_before(self, square_mm: u64, id: NodeId) -> bool {
        match self {
            Self::First => true,
            Self::Behind(last_mm, last) => (square_mm, id) > (last_mm, last),
        }
    }
}

impl fmt::Display for NodesCursor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First => Ok(()),
            Self::Behind(square_mm, id) => write!(f, "{square_mm}_{id}"),
        }
    }
}

impl FromStr for NodesCursor {
    type Err = ParseCursorError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text.is_empty() {
            return Ok(Self::First);
        }
        let error = || ParseCursorError::of(text);
        let (square_mm, id) = text.split_once('_').ok_or_else(error)?;
        let square_mm = square_mm.parse().map_err(|_| error())?;
        Ok(Self::Behind(square_mm, id.parse().map_err(|_| error())?))
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
    /// Nearest first, those equally near by their ids.
    pub nodes: Vec<NodeView>,
    /// Whether there are more nodes within the radius than `limit` let through.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub truncated: bool,
    /// What to ask as `after` for those that follow; absent unless truncated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}
