//! Paths that a robot plans itself, on its own copy of the map.

use crate::planned_path::{PathPoint, PlannedPath, Planner};
use fht_map::index::lookup;
use fht_map::plan::blocked::BlockedBy;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, PathEnds, Rules};
use fht_perception::pose::{Point2, fixed_point};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{FixedPoint, Footprint};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A robot outside of the mapped space goes to the nearest node within this distance first, metres.
const NEAREST_NODE_M: f64 = 8.0;

pub(crate) fn plan_inside(
    map: &MapState,
    space: &FreeSpace,
    rules: &Rules,
    (from, to, ends): (Point2, Point2, PathEnds),
) -> Result<PlannedPath, ErrorReply> {
    let config = NodeRouteConfig { ends, ..NodeRouteConfig::default() };
    let found = rules.plan(map, space, fixed_point(from), fixed_point(to), &config)?;
    let points = found
        .waypoints
        .iter()
        .map(|point| PathPoint { position: Point2::new(point.point.x(), point.point.y()), node: point.node });
    Ok(PlannedPath {
        points: points.collect(),
        length_m: found.length_m,
        planner: Planner::Replica,
        goal_moved_m: found.goal_moved_m,
        unmapped_m: found.unmapped_m,
    })
}

/// The node that a robot outside of the mapped space goes to first. None for one larger than the
/// explorers: nobody knows whether it fits through on the way there.
#[must_use]
pub fn entry_node(map: &MapState, footprint: &Footprint, from: Point2) -> Option<PathPoint> {
    if footprint.is_larger_than_explorers() { None } else { nearest_node(map, from) }
}

fn nearest_node(map: &MapState, from: Point2) -> Option<PathPoint> {
    let near = lookup::nearest(map, None, fixed_point(from), NEAREST_NODE_M);
    let (node, _) = near.first()?;
    Some(PathPoint { position: Point2::new(node.pose.position.x(), node.pose.position.y()), node: Some(node.id) })
}

/// The rules of a robot that knows of nothing but what it found blocked itself.
#[must_use]
pub fn rules_of_own(blocked: &BTreeSet<FixedPoint>) -> Arc<Rules> {
    Arc::new(with_own(Rules::default(), blocked))
}

pub(crate) fn with_own(mut rules: Rules, blocked: &BTreeSet<FixedPoint>) -> Rules {
    if !blocked.is_empty() {
        let robot = "this robot".to_owned();
        rules.blocked.push(BlockedBy { robot, edges: BTreeSet::new(), places: blocked.clone() });
    }
    rules
}

/// Section III-C-2: a robot outside of the mapped space goes to the nearest node first. `plan`
/// plans from where it is told.
///
/// # Errors
/// Why there is no path.
pub fn with_entry(
    from: Point2,
    entry: Option<PathPoint>,
    mut plan: impl FnMut(Point2) -> Result<PlannedPath, ErrorReply>,
) -> Result<PlannedPath, ErrorReply> {
    let refusal = match plan(from) {
        Err(refusal) if refusal.code == ErrorCode::OutOfMap => refusal,
        outcome => return outcome,
    };
    let Some(entry) = entry else { return Err(refusal) };
    let mut path = plan(entry.position).map_err(|_| refusal)?;
    let ahead_m = (entry.position - from).norm();
    path.length_m += ahead_m;
    path.unmapped_m += ahead_m;
    if let Some(first) = path.points.first_mut() {
        *first = entry;
    }
    path.points.insert(0, PathPoint { position: from, node: None });
    Ok(path)
}
