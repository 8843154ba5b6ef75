//! Whatever names a place on the map.

use fht_map::MapState;
use fht_perception::pose::{Point2, Pose2};
use fht_proto::api::reply::{ErrorCode, ErrorReply, PlaceRef, known_names};
use fht_proto::{FixedPose, NodeId};

/// A place on the map. Every function that takes one takes whatever turns into it:
///
/// | what | example |
/// | --- | --- |
/// | a point of the map frame, metres | `(5.0, 3.0)`, `Point2::new(5.0, 3.0)` |
/// | a pose of the map frame; a robot turns to its heading there | `Pose2` |
/// | a node | a [`NodeId`], `"1a2b3c4d.17"` |
/// | a place that an operator has named, with its heading | `"dock"` |
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// A point of the map frame, metres.
    Point(Point2),
    /// A pose of the map frame: metres and radians.
    Pose(Pose2),
    /// A node of the map.
    Node(NodeId),
    /// A text: the name of a place, a node's id, or `x,y` in metres.
    Text(String),
}

impl From<(f64, f64)> for Place {
    fn from((x, y): (f64, f64)) -> Self {
        Self::Point(Point2::new(x, y))
    }
}

impl From<[f64; 2]> for Place {
    fn from([x, y]: [f64; 2]) -> Self {
        Self::Point(Point2::new(x, y))
    }
}

impl From<Point2> for Place {
    fn from(point: Point2) -> Self {
        Self::Point(point)
    }
}

impl From<Pose2> for Place {
    fn from(pose: Pose2) -> Self {
        Self::Pose(pose)
    }
}

impl From<NodeId> for Place {
    fn from(id: NodeId) -> Self {
        Self::Node(id)
    }
}

impl From<&str> for Place {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Place {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl Place {
    /// The heading of a pose, radians.
    pub(crate) fn yaw(&self) -> Option<f64> {
        match self {
            Self::Pose(pose) => Some(pose.rotation.angle()),
            Self::Point(_) | Self::Node(_) | Self::Text(_) => None,
        }
    }

    /// The place as a query says it.
    pub(crate) fn to_ref(&self) -> Result<PlaceRef, ErrorReply> {
        match self {
            // As text, so that points without meaning are refused in the server's words.
            Self::Point(point) => format!("{:.3},{:.3}", point.x, point.y).parse(),
            Self::Pose(pose) => format!("{:.3},{:.3}", pose.translation.x, pose.translation.y).parse(),
            Self::Node(id) => Ok(PlaceRef::Node(*id)),
            Self::Text(text) => text.parse(),
        }
    }
}

/// A place in the text of a query.
pub(crate) fn in_query(place: &PlaceRef) -> String {
    match place {
        PlaceRef::Point(point) => format!("{:.3},{:.3}", point.x(), point.y()),
        PlaceRef::Node(id) => id.to_string(),
        PlaceRef::Named(name) => name.to_string(),
    }
}

/// Where a place is, map frame, and the heading there if it is a named one, radians. `now` has the
/// names, as operators name places for robots on every release; `running` has the nodes.
pub(crate) fn locate(
    now: &MapState,
    running: &MapState,
    place: &PlaceRef,
) -> Result<(Point2, Option<f64>), ErrorReply> {
    let unknown = |code, what: String| ErrorReply::new(code, &what);
    let point = |pose: FixedPose| Point2::new(pose.position.x(), pose.position.y());
    match place {
        PlaceRef::Point(point) => Ok((Point2::new(point.x(), point.y()), None)),
        PlaceRef::Node(id) => running
            .node(*id)
            .map(|node| (point(node.pose), None))
            .ok_or_else(|| unknown(ErrorCode::UnknownNode, format!("the own copy of the map has no node {id}"))),
        PlaceRef::Named(name) => now.annotations().place(name).map(|at| (point(at), Some(at.yaw()))).ok_or_else(|| {
            let known = known_names(now.annotations().places().map(|(name, _)| name));
            unknown(ErrorCode::UnknownPlace, format!("the own copy of the map has no place called {name} ({known})"))
        }),
    }
}

/// A place that somebody has named.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPlace {
    /// Its name.
    pub name: String,
    /// Its pose in the map frame.
    pub pose: Pose2,
}
