//! Where paths come from: the server's `path` query, or the robot's own replica when the server is silent.

use crate::pilot::PathSource;
use crate::replica::{AskError, LiveReplica, ask};
use crate::route::{PlannedPath, Planner, RoutePoint};
use fht_map::{MapState, RouteConfig, RouteError, lookup, route};
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{ErrorCode, ErrorReply, PathReply};
use fht_proto::{EdgeKey, FixedPoint, MapName};
use fht_robot::pose::Point2;
use std::collections::BTreeSet;
use std::time::Duration;
use zenoh::Session;

/// A robot outside of the mapped space goes to the nearest node within this distance first, metres.
const NEAREST_NODE_M: f64 = 8.0;

fn fixed(point: Point2) -> FixedPoint {
    FixedPoint::from_metres(point.x, point.y)
}

/// Plans on a map at hand.
///
/// # Errors
/// Why there is no path, in the server's words.
pub fn plan_on(
    map: &MapState,
    from: Point2,
    to: Point2,
    blocked: &BTreeSet<EdgeKey>,
) -> Result<PlannedPath, ErrorReply> {
    let entry = nearest_node(map, from);
    with_entry(from, entry, |start| plan_inside(map, start, to, blocked))
}

fn plan_inside(
    map: &MapState,
    from: Point2,
    to: Point2,
    blocked: &BTreeSet<EdgeKey>,
) -> Result<PlannedPath, ErrorReply> {
    let config = RouteConfig { blocked: blocked.clone(), ..RouteConfig::default() };
    let found = route::plan(map, fixed(from), fixed(to), &config).map_err(|error| {
        let code = match error {
            RouteError::NoPath { .. } => ErrorCode::NoPath,
            _ => ErrorCode::OutOfMap,
        };
        ErrorReply { code, message: error.to_string() }
    })?;
    let points = found
        .waypoints
        .iter()
        .map(|point| RoutePoint { position: Point2::new(point.point.x(), point.point.y()), node: point.node });
    Ok(PlannedPath { points: points.collect(), length_m: found.length_m, planner: Planner::Replica })
}

fn nearest_node(map: &MapState, from: Point2) -> Option<RoutePoint> {
    let near = lookup::nearest(map, fixed(from), NEAREST_NODE_M);
    let (node, _) = near.first()?;
    Some(RoutePoint { position: Point2::new(node.pose.position.x(), node.pose.position.y()), node: Some(node.id) })
}

/// Section III-C-2: a robot outside of the mapped space goes to the nearest node first. `plan` plans from where it is told.
fn with_entry(
    from: Point2,
    entry: Option<RoutePoint>,
    mut plan: impl FnMut(Point2) -> Result<PlannedPath, ErrorReply>,
) -> Result<PlannedPath, ErrorReply> {
    let refusal = match plan(from) {
        Err(refusal) if refusal.code == ErrorCode::OutOfMap => refusal,
        outcome => return outcome,
    };
    let Some(entry) = entry else { return Err(refusal) };
    let mut path = plan(entry.position).map_err(|_| refusal)?;
    path.length_m += (entry.position - from).norm();
    if let Some(first) = path.points.first_mut() {
        *first = entry;
    }
    path.points.insert(0, RoutePoint { position: from, node: None });
    Ok(path)
}

/// Asks the server for a path.
///
/// # Errors
/// Why there is none.
pub fn ask_path(
    session: &Session,
    map: &MapName,
    from: &str,
    to: &str,
    timeout: Duration,
) -> Result<PathReply, AskError> {
    let selector = format!("{}?from={from};to={to}", Key::topic(map, Topic::Path));
    let payloads = ask(session, &selector, timeout)?;
    let first = payloads.into_iter().next().ok_or(AskError::Silent)?;
    serde_json::from_slice(&first).map_err(|error| AskError::Unreadable(error.to_string()))
}

/// Paths from the server, and from the replica when the server is silent or edges are blocked (only this robot knows
/// of those).
pub struct ServerPaths<'a> {
    session: &'a Session,
    map: MapName,
    replica: &'a LiveReplica,
    timeout: Duration,
    fallbacks: usize,
}

impl<'a> ServerPaths<'a> {
    /// Asks through `session`, waiting `timeout` for answers.
    #[must_use]
    pub fn new(session: &'a Session, map: MapName, replica: &'a LiveReplica, timeout: Duration) -> Self {
        Self { session, map, replica, timeout, fallbacks: 0 }
    }

    /// How often the server was silent and the robot planned for itself.
    #[must_use]
    pub fn fallbacks(&self) -> usize {
        self.fallbacks
    }

    fn plan_once(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<EdgeKey>) -> Result<PlannedPath, ErrorReply> {
        if !blocked.is_empty() {
            return plan_inside(self.replica.read().state(), from, to, blocked);
        }
        let text = |point: Point2| format!("{:.3},{:.3}", point.x, point.y);
        match ask_path(self.session, &self.map, &text(from), &text(to), self.timeout) {
            Ok(reply) => Ok(planned(reply)),
            Err(AskError::Refused(refusal)) if refusal.code != ErrorCode::Internal => Err(refusal),
            Err(error) => {
                tracing::warn!(%error, "planning on the robot's own copy of the map");
                self.fallbacks += 1;
                plan_inside(self.replica.read().state(), from, to, blocked)
            }
        }
    }
}

/// The server's reply as a path.
#[must_use]
pub fn planned(reply: PathReply) -> PlannedPath {
    let points = reply.waypoints.into_iter().map(|waypoint| RoutePoint {
        position: Point2::new(waypoint.x, waypoint.y),
        node: waypoint.node.and_then(|id| id.parse().ok()),
    });
    PlannedPath { points: points.collect(), length_m: reply.length_m, planner: Planner::Server }
}

impl PathSource for ServerPaths<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<EdgeKey>) -> Result<PlannedPath, ErrorReply> {
        let entry = nearest_node(self.replica.read().state(), from);
        with_entry(from, entry, |start| self.plan_once(start, to, blocked))
    }
}
