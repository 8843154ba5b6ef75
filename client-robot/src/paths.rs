//! Where paths come from: the robot's own replica at once, and the server's `path` query when its answer comes. The loop
//! that drives the robot never waits for the network.

use crate::free_space::FreeSpaceCache;
use crate::inquiry::{Inquiry, Taking};
use crate::pilot::PathSource;
use crate::replica::{AskError, LiveReplica, ask};
use crate::route::{PlannedPath, Planner, RoutePoint};
use fht_map::blocked::BlockedBy;
use fht_map::{FreeSpace, MapState, RouteConfig, Rules, lookup};
use fht_proto::fleet::BlockedReport;
use fht_proto::keys::{Key, RobotTopic, Topic};
use fht_proto::query::{ErrorCode, ErrorReply, PathReply};
use fht_proto::{FixedPoint, MapName};
use fht_robot::pose::{Point2, fixed_point};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;
use zenoh::{Session, Wait};

/// A robot outside of the mapped space goes to the nearest node within this distance first, metres.
const NEAREST_NODE_M: f64 = 8.0;

pub(crate) fn plan_inside(
    map: &MapState,
    space: &FreeSpace,
    rules: &Rules,
    from: Point2,
    to: Point2,
) -> Result<PlannedPath, ErrorReply> {
    let found = rules.plan(map, space, fixed_point(from), fixed_point(to), &RouteConfig::default());
    let found = found.map_err(|error| ErrorReply { code: error.code(), message: error.to_string() })?;
    let points = found
        .waypoints
        .iter()
        .map(|point| RoutePoint { position: Point2::new(point.point.x(), point.point.y()), node: point.node });
    Ok(PlannedPath { points: points.collect(), length_m: found.length_m, planner: Planner::Replica })
}

pub(crate) fn nearest_node(map: &MapState, from: Point2) -> Option<RoutePoint> {
    let near = lookup::nearest(map, fixed_point(from), NEAREST_NODE_M);
    let (node, _) = near.first()?;
    Some(RoutePoint { position: Point2::new(node.pose.position.x(), node.pose.position.y()), node: Some(node.id) })
}

/// The rules of a robot that knows of nothing but what it found blocked itself.
#[must_use]
pub fn rules_of_own(blocked: &BTreeSet<FixedPoint>) -> Arc<Rules> {
    Arc::new(with_own(Rules::default(), blocked))
}

fn with_own(mut rules: Rules, blocked: &BTreeSet<FixedPoint>) -> Rules {
    if !blocked.is_empty() {
        let robot = "this robot".to_owned();
        rules.blocked.push(BlockedBy { robot, edges: BTreeSet::new(), places: blocked.clone() });
    }
    rules
}

/// Section III-C-2: a robot outside of the mapped space goes to the nearest node first. `plan` plans from where it is told.
pub(crate) fn with_entry(
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

/// How the server is asked.
#[derive(Clone, Debug)]
pub struct ServerPathsConfig {
    /// How long the server may take. Default 5 s.
    pub timeout: Duration,
    /// When its answer is taken, and free space that is made beside the loop. Default two frames after the question, for
    /// simulated time.
    pub taking: Taking,
    /// For how long others are to avoid what this robot finds blocked, seconds. Default 30, as the robot does itself.
    pub blocked_for_s: f64,
}

impl Default for ServerPathsConfig {
    fn default() -> Self {
        Self { timeout: Duration::from_secs(5), taking: Taking::AfterFrames(2), blocked_for_s: 30.0 }
    }
}

struct Question {
    from: Point2,
    to: Point2,
    entry: Option<RoutePoint>,
}

/// What the server answered: a path, a refusal, or nothing of use (a sentence).
type Answer = Result<Result<PlannedPath, ErrorReply>, String>;

/// Paths from the replica, replaced by the server's when its answer comes and is a path. Around places that this robot found
/// blocked from the replica alone, and others are told of them.
pub struct ServerPaths<'a> {
    replica: &'a LiveReplica,
    session: Session,
    blocked_key: String,
    blocked_for_s: f64,
    /// What others were told last.
    told: BTreeSet<FixedPoint>,
    /// What held when a path was last asked for.
    rules: Arc<Rules>,
    inquiry: Inquiry<Question, Answer>,
    free_space: FreeSpaceCache,
    fallbacks: usize,
}

impl<'a> ServerPaths<'a> {
    /// Asks through `session`, from a thread of its own.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn new(
        session: &Session,
        map: MapName,
        robot: &str,
        replica: &'a LiveReplica,
        config: &ServerPathsConfig,
    ) -> std::io::Result<Self> {
        let blocked_key = Key::robot(&map, robot, RobotTopic::Blocked).to_string();
        let (asking, timeout) = (session.clone(), config.timeout);
        let ask = move |question: Question| answer(&asking, &map, question, timeout);
        // With an entry the server is asked twice.
        let inquiry = Inquiry::start(config.taking, 3 * timeout, ask)?;
        Ok(Self {
            replica,
            session: session.clone(),
            blocked_key,
            blocked_for_s: config.blocked_for_s,
            told: BTreeSet::new(),
            rules: Arc::default(),
            inquiry,
            free_space: FreeSpaceCache::beside(config.taking),
            fallbacks: 0,
        })
    }

    /// Tells the others what this robot found blocked. Lost, it is said again with the next place.
    fn tell(&mut self, blocked: &BTreeSet<FixedPoint>) {
        if *blocked == self.told {
            return;
        }
        self.told.clone_from(blocked);
        let places = blocked.iter().take(BlockedReport::MAX_THINGS).map(|place| [place.x(), place.y()]).collect();
        let report = BlockedReport { for_s: self.blocked_for_s, edges: Vec::new(), places };
        let Ok(json) = serde_json::to_vec(&report) else { return };
        let put = self.session.put(&self.blocked_key, json).encoding(zenoh::bytes::Encoding::APPLICATION_JSON).wait();
        if let Err(error) = put {
            tracing::debug!(%error, "a blocked place was not told");
        }
    }

    /// How often the server was silent, or answered with what is no path, and the robot kept its own.
    #[must_use]
    pub fn fallbacks(&self) -> usize {
        self.fallbacks
    }
}

fn answer(session: &Session, map: &MapName, question: Question, timeout: Duration) -> Answer {
    let text = |point: Point2| format!("{:.3},{:.3}", point.x, point.y);
    let Question { from, to, entry } = question;
    let mut failure = None;
    let path = with_entry(from, entry, |start| {
        let reply = ask_path(session, map, &text(start), &text(to), timeout);
        let path = reply.and_then(|reply| {
            planned_between(reply, start, to).map_err(|error| AskError::Unreadable(error.to_string()))
        });
        path.map_err(|error| match error {
            AskError::Refused(refusal) if refusal.code != ErrorCode::Internal => refusal,
            error => {
                let message = error.to_string();
                failure = Some(message.clone());
                ErrorReply { code: ErrorCode::Internal, message }
            }
        })
    });
    failure.map_or(Ok(path), Err)
}

/// Farthest coordinate of a path, metres: as for nodes (`fht_proto`).
const MAX_COORDINATE_M: f64 = 100_000.0;
/// A path begins and ends this near to where it was asked to, metres. The question is put in whole millimetres.
const ENDS_WITHIN_M: f64 = 0.5;

/// Why a reply of the server is no path that a robot should drive.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnusablePath {
    /// There is nothing to drive to.
    #[error("the path has no waypoints")]
    Empty,
    /// A waypoint is not a place.
    #[error("waypoint {index} of the path, ({x}, {y}), is not within {MAX_COORDINATE_M} m of the map's origin")]
    FarAway {
        /// Which, from 0.
        index: usize,
        /// Metres, as it came.
        x: f64,
        /// Metres, as it came.
        y: f64,
    },
    /// The length is none.
    #[error("the path's length is {0} m")]
    Length(f64),
    /// It is an answer to something else.
    #[error("the path leads from ({:.2}, {:.2}) to ({:.2}, {:.2}), asked was ({:.2}, {:.2}) to ({:.2}, {:.2})",
        path[0].x, path[0].y, path[1].x, path[1].y, asked[0].x, asked[0].y, asked[1].x, asked[1].y)]
    Elsewhere {
        /// Its first and last points.
        path: [Point2; 2],
        /// Those that were asked for.
        asked: [Point2; 2],
    },
}

/// The server's reply as a path, if it is one.
///
/// # Errors
/// [`UnusablePath`]: empty, or not finite, or beyond 100 km.
pub fn planned(reply: PathReply) -> Result<PlannedPath, UnusablePath> {
    if reply.waypoints.is_empty() {
        return Err(UnusablePath::Empty);
    }
    let is_near = |metres: f64| metres.abs() <= MAX_COORDINATE_M;
    let far = reply.waypoints.iter().position(|waypoint| !(is_near(waypoint.x) && is_near(waypoint.y)));
    if let Some(index) = far {
        let waypoint = &reply.waypoints[index];
        return Err(UnusablePath::FarAway { index, x: waypoint.x, y: waypoint.y });
    }
    if !(reply.length_m.is_finite() && reply.length_m >= 0.0) {
        return Err(UnusablePath::Length(reply.length_m));
    }
    let points = reply.waypoints.into_iter().map(|waypoint| RoutePoint {
        position: Point2::new(waypoint.x, waypoint.y),
        node: waypoint.node.and_then(|id| id.parse().ok()),
    });
    Ok(PlannedPath { points: points.collect(), length_m: reply.length_m, planner: Planner::Server })
}

/// The server's reply as a path between two points of the map frame.
///
/// # Errors
/// [`UnusablePath`], also when it begins or ends elsewhere.
pub fn planned_between(reply: PathReply, from: Point2, to: Point2) -> Result<PlannedPath, UnusablePath> {
    let path = planned(reply)?;
    if let (Some(first), Some(last)) = (path.points.first(), path.points.last())
        && ((first.position - from).norm() > ENDS_WITHIN_M || (last.position - to).norm() > ENDS_WITHIN_M)
    {
        return Err(UnusablePath::Elsewhere { path: [first.position, last.position], asked: [from, to] });
    }
    Ok(path)
}

impl PathSource for ServerPaths<'_> {
    fn plan(&mut self, from: Point2, to: Point2, blocked: &BTreeSet<FixedPoint>) -> Result<PlannedPath, ErrorReply> {
        self.tell(blocked);
        let changes = self.replica.changes();
        let map = self.replica.running();
        if blocked.is_empty() {
            self.inquiry.put(Question { from, to, entry: nearest_node(&map, from) });
        } else {
            self.inquiry.cancel();
        }
        self.rules = self.replica.rules();
        let rules = if blocked.is_empty() {
            Arc::clone(&self.rules)
        } else {
            Arc::new(with_own(self.rules.as_ref().clone(), blocked))
        };
        self.free_space.plan(&map, changes, from, to, &rules)
    }

    fn is_outdated(&self) -> bool {
        !self.rules.closes_the_same(&self.replica.rules())
    }

    fn speed_limit_mps(&self, place: Point2) -> Option<f64> {
        self.replica.rules().speed_limit_mps(fixed_point(place))
    }

    fn is_pending(&self) -> bool {
        self.inquiry.is_pending() || self.free_space.is_pending()
    }

    fn revised(&mut self) -> Option<Result<PlannedPath, ErrorReply>> {
        // Both are taken each frame; of two that come together the server's counts.
        let answer = self.inquiry.take();
        let own = self.free_space.revised(|| self.replica.running());
        match answer {
            Some(Ok(Ok(path))) => {
                self.free_space.forget_wish();
                return Some(Ok(path));
            }
            Some(Ok(Err(refusal))) => tracing::info!(%refusal, "the server has no path"),
            Some(Err(error)) => {
                tracing::warn!(%error, "no path from the server: planning on the robot's own copy of the map");
                self.fallbacks += 1;
            }
            None => {}
        }
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::query::Waypoint;

    fn reply(points: &[(f64, f64)]) -> PathReply {
        let waypoints = points.iter().map(|&(x, y)| Waypoint { x, y, node: None }).collect();
        PathReply {
            map: "m".parse().expect("a name"),
            version: 1,
            release: None,
            length_m: 1.0,
            waypoints,
            obeyed: Vec::new(),
            speed_limits: Vec::new(),
        }
    }

    #[test]
    fn a_reply_is_driven_only_if_it_is_the_path_that_was_asked_for() {
        let (from, to) = (Point2::new(0.0, 0.0), Point2::new(4.0, 1.0));
        let judge = |points: &[(f64, f64)]| planned_between(reply(points), from, to);
        assert!(judge(&[(0.0, 0.001), (2.0, 2.0), (4.0, 1.0)]).is_ok_and(|path| path.planner == Planner::Server));
        assert_eq!(judge(&[]), Err(UnusablePath::Empty));
        for far in [1e12, f64::NAN, f64::NEG_INFINITY, -100_001.0] {
            let error = judge(&[(0.0, 0.0), (far, 0.0), (4.0, 1.0)]);
            assert!(matches!(error, Err(UnusablePath::FarAway { index: 1, .. })), "{far}: {error:?}");
        }
        for elsewhere in [[(0.0, 0.0), (40.0, 1.0)], [(5.0, 0.0), (4.0, 1.0)]] {
            assert!(matches!(judge(&elsewhere), Err(UnusablePath::Elsewhere { .. })));
        }
        let endless = PathReply { length_m: f64::NAN, ..reply(&[(0.0, 0.0), (4.0, 1.0)]) };
        assert!(matches!(planned_between(endless, from, to), Err(UnusablePath::Length(_))));
    }
}
