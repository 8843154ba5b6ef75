//! Whether a reply of the server is a path that a robot should drive.

use crate::planned_path::{PathPoint, PlannedPath, Planner};
use fht_map::Rules;
use fht_perception::pose::Point2;
use fht_proto::FixedPoint;
use fht_proto::api::reply::PathReply;

/// Farthest coordinate of a path, metres: as for nodes (`fht_proto`).
const MAX_COORDINATE_M: f64 = FixedPoint::MAX_M;
/// A path begins and ends this near to where it was asked to, metres. The question is put in whole
/// millimetres.
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
    /// It is of before something was closed.
    #[error("the server does not know yet of everything that is closed here")]
    Outdated,
}

/// Whether the server planned under what operators have closed here.
///
/// # Errors
/// [`UnusablePath::Outdated`].
pub fn check_kept(reply: &PathReply, rules: &Rules) -> Result<(), UnusablePath> {
    let way: Vec<FixedPoint> = reply.waypoints.iter().map(|at| FixedPoint::from_metres(at.x, at.y)).collect();
    if rules.are_kept_by(&reply.obeyed, &way) { Ok(()) } else { Err(UnusablePath::Outdated) }
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
    for length_m in [reply.length_m, reply.goal_moved_m, reply.unmapped_m] {
        if !(length_m.is_finite() && length_m >= 0.0) {
            return Err(UnusablePath::Length(length_m));
        }
    }
    let points = reply.waypoints.into_iter().map(|waypoint| PathPoint {
        position: Point2::new(waypoint.x, waypoint.y),
        node: waypoint.node.and_then(|id| id.parse().ok()),
    });
    Ok(PlannedPath {
        points: points.collect(),
        length_m: reply.length_m,
        planner: Planner::Server,
        goal_moved_m: reply.goal_moved_m,
        unmapped_m: reply.unmapped_m,
    })
}

/// The server's reply as a path between two points of the map frame; it may end elsewhere if it
/// says so ([`PlannedPath::goal_moved_m`]).
///
/// # Errors
/// [`UnusablePath`], also when it begins or ends elsewhere.
pub fn planned_between(reply: PathReply, from: Point2, to: Point2) -> Result<PlannedPath, UnusablePath> {
    let path = planned(reply)?;
    if let (Some(first), Some(last)) = (path.points.first(), path.points.last())
        && ((first.position - from).norm() > ENDS_WITHIN_M
            || (last.position - to).norm() > ENDS_WITHIN_M + path.goal_moved_m)
    {
        return Err(UnusablePath::Elsewhere { path: [first.position, last.position], asked: [from, to] });
    }
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::api::reply::Waypoint;

    fn reply(points: &[(f64, f64)]) -> PathReply {
        let waypoints = points.iter().map(|&(x, y)| Waypoint { x, y, node: None }).collect();
        PathReply {
            map: "m".parse().expect("a name"),
            version: 1,
            release: None,
            length_m: 1.0,
            waypoints,
            goal_moved_m: 0.0,
            unmapped_m: 0.0,
            goal_yaw: None,
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
