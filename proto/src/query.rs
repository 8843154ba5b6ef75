//! Requests and replies. Replies are JSON by default (`application/json`), `fmt=postcard` asks for the form in
//! [`crate::compact`].
//! Errors are error replies with an [`ErrorReply`] as JSON, never silence.

use crate::geometry::{FixedPoint, Rect};
use crate::ids::{MapName, NodeId};
use crate::increment::{Increment, NodeKind};
use crate::validate::{Invalid, Validate, check};
use crate::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// What went wrong, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum ErrorCode {
    /// Both places are in the map but nothing joins them.
    NoPath,
    /// A place is not in or near the mapped space.
    OutOfMap,
    /// There is no such map.
    UnknownMap,
    /// There is no such version or release of the map.
    UnknownVersion,
    /// There is no such node.
    UnknownNode,
    /// The descriptor is of a model that this map does not use.
    IncompatibleModel,
    /// The request cannot be read.
    BadRequest,
    /// The server failed.
    Internal,
    /// Another increment of this author and number is stored.
    Conflict,
    /// An increment is not in the one form that its content has in bytes.
    NotCanonical,
    /// A limit of the server is reached: of a map, of maps, or of all of them together.
    Full,
    /// An increment is stamped too far ahead of the server's clock.
    Future,
    /// An increment is longer than the server takes.
    TooLong,
    /// A code that this program does not know: its sender is newer.
    #[serde(other)]
    Unknown,
}

impl ErrorCode {
    /// Whether a refused increment would be refused again, however often it is sent.
    #[must_use]
    pub fn is_permanent_refusal(self) -> bool {
        matches!(self, Self::Conflict | Self::NotCanonical | Self::Full | Self::Future | Self::TooLong)
    }
}

/// The payload of an error reply, and of what the server puts under a writer's `refused` key.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{message}")]
pub struct ErrorReply {
    /// For programs.
    pub code: ErrorCode,
    /// One sentence for people, without quotes and backslashes: tools show the JSON of this with escapes.
    pub message: String,
}

/// A place in a request: `x,y` in metres or a node id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Coordinates in the map frame.
    Point(FixedPoint),
    /// The place of a node.
    Node(NodeId),
}

impl FromStr for Place {
    type Err = ErrorReply;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Ok(id) = text.parse() {
            return Ok(Self::Node(id));
        }
        parse_point(text).map(Self::Point)
    }
}

/// Parses `x,y` (metres).
///
/// # Errors
/// `BAD_REQUEST` with the text and what was expected.
pub fn parse_point(text: &str) -> Result<FixedPoint, ErrorReply> {
    let shown: String = text.chars().take(80).collect();
    let bad = || ErrorReply {
        code: ErrorCode::BadRequest,
        message: format!("{shown} is not a place: give x,y in metres, such as 1.5,-2, or a node id"),
    };
    let (x, y) = text.split_once(',').ok_or_else(bad)?;
    let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite() && v.abs() <= 100_000.0);
    match (number(x), number(y)) {
        (Some(x), Some(y)) => Ok(FixedPoint::from_metres(x, y)),
        _ => Err(bad()),
    }
}

/// The state of a map: reply and publication under `head`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Head {
    /// The map.
    pub map: MapName,
    /// Sum of the vector.
    pub version: u64,
    /// Increments contained, all durable: the acknowledgement of the writers.
    pub vector: VersionVector,
    /// Hash of the canonical map.
    pub digest: Digest,
    /// Main nodes shown.
    pub main_nodes: usize,
    /// Support nodes shown.
    pub support_nodes: usize,
    /// Edges shown.
    pub edges: usize,
    /// Bytes of all increments as they travelled.
    pub bytes: u64,
    /// Increments refused since the server started.
    pub refused: u64,
}

impl Head {
    /// The head, if it makes sense and is one of `map`: what everybody asks of a head that came from outside. The numbers in
    /// its vector may still be anything.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn checked(self, map: &MapName) -> Result<Self, Invalid> {
        check(self.map == *map, || format!("a head of map {} where one of {map} was expected", self.map))?;
        self.validate()?;
        Ok(self)
    }
}

/// The reply to `since` and `snapshot`: one message of limited size, the first increments that the asker lacks. The asker
/// takes them in and asks again with its new vector (`since?vector=…`, `snapshot?version=…;have=…`), until a reply is empty.
/// Both vectors are of the form that [`VersionVector`] is shown in; without them the asker has nothing yet. (One sample an increment would not do: of
/// several replies under one key, a Zenoh query delivers one by default.)
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// The increments, in an order in which each author's numbers ascend.
    pub increments: Vec<Increment>,
}

/// A point of a path.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Waypoint {
    /// Metres in the map frame.
    pub x: f64,
    /// Metres in the map frame.
    pub y: f64,
    /// The node passed, none at the start and at the goal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<String>,
}

/// The reply to `path`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathReply {
    /// The map.
    pub map: MapName,
    /// The version that the path was planned on.
    pub version: u64,
    /// Its length over all waypoints, metres.
    pub length_m: f64,
    /// From start to goal.
    pub waypoints: Vec<Waypoint>,
}

/// One node as `nodes` and `match` show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
pub struct NodesReply {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// Nearest first.
    pub nodes: Vec<NodeView>,
}

/// The reply to `maps`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapsReply {
    /// Heads of all maps, by name.
    pub maps: Vec<Head>,
}

/// What a robot says of where it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum LocalizationState {
    /// Nothing fits yet.
    NotLocalized,
    /// Something fits, but too little or too ambiguously.
    Candidates,
    /// It knows.
    Localized,
    /// It knew, and what it senses no longer fits.
    Lost,
}

impl std::fmt::Display for LocalizationState {
    /// As it is written in JSON.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::NotLocalized => "NOT_LOCALIZED",
            Self::Candidates => "CANDIDATES",
            Self::Localized => "LOCALIZED",
            Self::Lost => "LOST",
        })
    }
}

/// What a robot puts under its `pose` key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotPose {
    /// The robot's name.
    pub robot: String,
    /// Whether it knows where it is; if not, the pose is absent.
    pub localized: bool,
    /// The same, told apart.
    pub state: LocalizationState,
    /// Probability that the pose, or the likeliest candidate, is right, as the robot sees it: 0 to 1.
    pub confidence: f64,
    /// Where it may be, likeliest first, at most five: `[x, y, yaw]` in the map frame, metres and radians. Empty once it knows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<[f64; 3]>,
    /// `[x, y, yaw]` in the map frame, metres and radians.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map_from_base: Option<[f64; 3]>,
}
