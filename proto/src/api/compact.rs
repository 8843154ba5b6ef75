//! The compact replies: what `fmt=postcard` asks for. Their JSON forms in [`crate::api::reply`]
//! show ids as text and leave out what is absent, which `postcard` cannot read back.

use crate::codec::envelope::Message;
use crate::model::geometry::{FixedPoint, FixedPose, Rect};
use crate::model::ids::{MapName, NodeId};
use crate::model::increment::NodeKind;
use crate::model::signature::Signature;
use crate::model::validate::{Invalid, Validate, check};
use serde::{Deserialize, Serialize};

/// A point of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompactWaypoint {
    /// Where, in the map frame.
    pub point: FixedPoint,
    /// The node passed, none at the start and at the goal.
    pub node: Option<NodeId>,
}

/// The reply to `path`. Its length follows from its points.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompactPath {
    /// The map.
    pub map: MapName,
    /// The version that the path was planned on.
    pub version: u64,
    /// From start to goal.
    pub waypoints: Vec<CompactWaypoint>,
}

/// The reply to `path` for who gives `to_nearest` or `goal_yaw=true`, with what became of the goal.
/// It is a message of its own: a reader of [`CompactPath`] refuses what it does not know.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompactPathWithGoal {
    /// The path.
    pub path: CompactPath,
    /// How far its last point is from the goal that was asked for, millimetres.
    pub goal_moved_mm: u32,
    /// How much of it leads over ground that the map knows nothing of, millimetres.
    pub unmapped_mm: u32,
    /// The heading at the goal in units of 1e-4 rad; there if the goal is a named place.
    pub goal_yaw_e4: Option<i16>,
}

/// One node, whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompactNode {
    /// Its id.
    pub id: NodeId,
    /// Main or support.
    pub kind: NodeKind,
    /// Its pose in the map frame.
    pub pose: FixedPose,
    /// Its rectangle of free space.
    pub free_space: Option<Rect>,
    /// Descriptor and scan (`match` only).
    pub signature: Option<Signature>,
    /// Cosine to the descriptor asked for (`match` only).
    pub similarity: Option<f32>,
}

/// A page of the reply to `nodes` when `after` is given, whatever it says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompactNodesPage {
    /// The nodes.
    pub nodes: CompactNodes,
    /// Where the next page begins, as `after` takes it; none if this is the last one.
    pub next: Option<String>,
}

/// The reply to `nodes` (nearest first) and to `match` (most similar first): for robots too small
/// to hold the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompactNodes {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// The nodes.
    pub nodes: Vec<CompactNode>,
}

impl Message for CompactPath {
    const KIND: u8 = 4;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

impl Validate for CompactPath {
    fn validate(&self) -> Result<(), Invalid> {
        self.waypoints.iter().try_for_each(|waypoint| waypoint.point.validate())
    }
}

impl Message for CompactPathWithGoal {
    const KIND: u8 = 9;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

impl Validate for CompactPathWithGoal {
    fn validate(&self) -> Result<(), Invalid> {
        let goal = self.path.waypoints.last();
        let pose = goal.zip(self.goal_yaw_e4).map(|(goal, yaw_e4)| FixedPose { position: goal.point, yaw_e4 });
        self.path.validate().and(pose.map_or(Ok(()), |pose| pose.validate()))
    }
}

impl Message for CompactNodes {
    const KIND: u8 = 5;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

impl Message for CompactNodesPage {
    const KIND: u8 = 10;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

impl Validate for CompactNodesPage {
    fn validate(&self) -> Result<(), Invalid> {
        self.nodes.validate()
    }
}

impl Validate for CompactNodes {
    fn validate(&self) -> Result<(), Invalid> {
        self.nodes.iter().try_for_each(|node| {
            node.pose.validate()?;
            check(node.similarity.is_none_or(f32::is_finite), || "a similarity that is not finite".to_owned())?;
            node.signature.as_ref().map_or(Ok(()), Validate::validate)
        })
    }
}
