//! Requests and replies. Replies are JSON by default (`application/json`), `fmt=postcard` asks for the form in
//! [`crate::compact`].
//! Errors are error replies with an [`ErrorReply`] as JSON, never silence.

use crate::annotation::{Label, ZoneRule};
use crate::fleet::BlockedReport;
use crate::fold::Fold;
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
    /// There is no place of this name.
    UnknownPlace,
    /// The goal lies in a zone that no robot may enter, or the start does and there is no way out.
    KeepOut,
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

impl ErrorReply {
    /// An error reply. Texts of others may have come into the sentence: what tools would show with escapes is left out.
    #[must_use]
    pub fn new(code: ErrorCode, message: &str) -> Self {
        let is_plain = |c: &char| !matches!(c, '\'' | '"' | '\\') && !c.is_control();
        Self { code, message: message.chars().filter(is_plain).collect() }
    }
}

/// A place in a request: `x,y` in metres, a node id, or the name of a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// Coordinates in the map frame.
    Point(FixedPoint),
    /// The place of a node.
    Node(NodeId),
    /// A place that an operator has named.
    Named(Label),
}

impl FromStr for Place {
    type Err = ErrorReply;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Ok(id) = text.parse() {
            return Ok(Self::Node(id));
        }
        if let Ok(name) = text.parse() {
            return Ok(Self::Named(name));
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
    let bad = || {
        let text =
            format!("{shown} is not a place: give x,y in metres, such as 1.5,-2, a node id or the name of a place");
        ErrorReply::new(ErrorCode::BadRequest, &text)
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
    /// The newest clock in it, microseconds: whoever writes stamps with more.
    #[serde(default)]
    pub clock_us: u64,
    /// The release that robots are to use, as `name@author`; none: this state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enabled: Option<String>,
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// What is left of increments that were folded; they come before all others of their author.
    pub folds: Vec<Fold>,
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

/// What a path obeys.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
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
pub struct SpeedLimit {
    /// The zone's name.
    pub zone: String,
    /// Metres per second.
    pub max_mps: f64,
    /// Where the path enters and leaves it, metres along the path.
    pub along_m: [f64; 2],
}

/// The reply to `path`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// What operators and robots have closed, and the path keeps out of.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obeyed: Vec<Obeyed>,
    /// Zones of limited speed that it leads through, in the order in which they are entered.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub speed_limits: Vec<SpeedLimit>,
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
    /// How far it is believed, 0 to 100; absent if nobody has doubted it.
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

/// A release in the reply to `releases`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReleaseView {
    /// Its name.
    pub name: String,
    /// Who made it.
    pub author: String,
    /// The version that it names.
    pub version: u64,
    /// The increments that it consists of.
    pub vector: VersionVector,
    /// Hash of the map that they add up to.
    pub digest: Digest,
    /// When it was made, microseconds since the Unix epoch by its author's clock.
    pub made_us: u64,
    /// Whether robots are to use it.
    pub enabled: bool,
    /// Whether this server has all of it.
    pub available: bool,
}

/// The reply to `releases`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReleasesReply {
    /// The map.
    pub map: MapName,
    /// Its newest version.
    pub version: u64,
    /// Oldest first.
    pub releases: Vec<ReleaseView>,
}

/// A named place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaceView {
    /// Its name.
    pub name: String,
    /// `[x, y, yaw]` in the map frame, metres and radians.
    pub pose: [f64; 3],
}

/// A zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ZoneView {
    /// Its name.
    pub name: String,
    /// What holds there.
    pub rule: ZoneRule,
    /// Its corners `[x, y]` in the map frame, metres.
    pub corners: Vec<[f64; 2]>,
}

/// Something that a robot found blocked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlockedView {
    /// The robot.
    pub robot: String,
    /// For how much longer it is avoided, seconds.
    pub for_s: f64,
    /// Edges, each by the ids of its ends.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<[String; 2]>,
    /// Places, `[x, y]` in the map frame, metres.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<[f64; 2]>,
}

impl BlockedView {
    /// The robot, and its report as if it came now. `None` of a view without anything: as a report that would take back what the robot said.
    #[must_use]
    pub fn into_report(self) -> Option<(String, BlockedReport)> {
        let Self { robot, for_s, edges, places } = self;
        let says_something = !(edges.is_empty() && places.is_empty());
        says_something.then_some((robot, BlockedReport { for_s, edges, places }))
    }
}

/// The reply to `rules`: what operators and robots have added to the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RulesReply {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// Named places.
    pub places: Vec<PlaceView>,
    /// Zones.
    pub zones: Vec<ZoneView>,
    /// Edges that operators have closed, each by the ids of its ends.
    pub closed_edges: Vec<[String; 2]>,
    /// What robots found blocked, and for how long yet.
    pub blocked: Vec<BlockedView>,
}

/// A state in a `diff`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateView {
    /// Sum of the vector.
    pub version: u64,
    /// The increments.
    pub vector: VersionVector,
    /// Hash of the map.
    pub digest: Digest,
}

/// A node that moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MovedNode {
    /// Its id.
    pub id: String,
    /// How far, metres.
    pub by_m: f64,
}

/// The reply to `diff`: what has to be done to one state to get the other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiffReply {
    /// The map.
    pub map: MapName,
    /// The state compared with.
    pub from: StateView,
    /// The state that is compared.
    pub to: StateView,
    /// Nodes that are new.
    pub added_nodes: Vec<String>,
    /// Nodes that are gone.
    pub removed_nodes: Vec<String>,
    /// Nodes that lie elsewhere.
    pub moved_nodes: Vec<MovedNode>,
    /// Nodes whose kind, rectangle, signature or trust is another.
    pub changed_nodes: Vec<String>,
    /// Edges that are new.
    pub added_edges: Vec<[String; 2]>,
    /// Edges that are gone.
    pub removed_edges: Vec<[String; 2]>,
    /// Edges that are closed now.
    pub closed_edges: Vec<[String; 2]>,
    /// Edges that are open again.
    pub opened_edges: Vec<[String; 2]>,
    /// Named places, zones and releases that are new, gone or other: `place dock`, `zone lab`, `release 2026-11-21.1@1a2b3c4d`.
    pub annotations: Vec<String>,
    /// The same in a sentence.
    pub words: String,
}
