//! From any place to any place (paper, section III-C-2, equation 5).
//!
//! A place inside a node's rectangle reaches that node in a straight line; a place inside no rectangle reaches nodes
//! near it at `k` times the distance. Among all ways in and out the cheapest wins: one Dijkstra from all of the
//! start's nodes at once.

use crate::graph::Graph;
use crate::state::{MapState, NodeRef};
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use std::collections::BTreeSet;

/// Parameters of the route.
#[derive(Clone, Debug)]
pub struct RouteConfig {
    /// k of equation 5: what a metre outside of all rectangles costs. Default 10.
    pub outside_factor: f64,
    /// A place farther than this from every node's rectangle (or node) is out of the map, metres. Default 1.
    pub max_outside_m: f64,
    /// Edges that must not be used.
    pub blocked: BTreeSet<EdgeKey>,
}

impl Default for RouteConfig {
    fn default() -> Self {
        Self { outside_factor: 10.0, max_outside_m: 1.0, blocked: BTreeSet::new() }
    }
}

/// A point of a route.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoutePoint {
    /// Where, in the map frame.
    pub point: FixedPoint,
    /// The node passed; none at the start and at the goal.
    pub node: Option<NodeId>,
}

/// A way from start to goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// Length over all points, metres.
    pub length_m: f64,
    /// From start to goal.
    pub points: Vec<RoutePoint>,
}

/// Why there is no route.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RouteError {
    /// A place is not in the mapped space.
    #[error("{what} ({:.2}, {:.2}) is not in the mapped space{}", place.x(), place.y(), nearest_text(*nearest_m))]
    OutOfMap {
        /// "the start" or "the goal".
        what: &'static str,
        /// The place.
        place: FixedPoint,
        /// Distance to the nearest free rectangle, metres, if the map has any.
        nearest_m: Option<f64>,
    },
    /// Nothing joins the two places.
    #[error("no path joins ({:.2}, {:.2}) and ({:.2}, {:.2})", from.x(), from.y(), to.x(), to.y())]
    NoPath {
        /// The start.
        from: FixedPoint,
        /// The goal.
        to: FixedPoint,
    },
}

fn nearest_text(nearest_m: Option<f64>) -> String {
    nearest_m.map_or_else(
        || ": the map is empty".to_owned(),
        |metres| format!(": the nearest free space is {metres:.2} m away"),
    )
}

/// Distance from a place to a node's rectangle, 0 inside; to the node itself if it has none.
fn distance_to_free_space(node: &NodeRef<'_>, place: FixedPoint) -> f64 {
    let centre = node.pose.position;
    node.free_space.map_or_else(
        || centre.distance(place),
        |rect| {
            let (min, max) = (rect.min(centre), rect.max(centre));
            let outside = |value: f64, low: f64, high: f64| (low - value).max(value - high).max(0.0);
            outside(place.x(), min.0, max.0).hypot(outside(place.y(), min.1, max.1))
        },
    )
}

/// The nodes by which a place is joined to the map, each with what it costs to reach it.
fn access(
    state: &MapState,
    place: FixedPoint,
    what: &'static str,
    config: &RouteConfig,
) -> Result<Vec<(NodeId, f64)>, RouteError> {
    let candidates: Vec<(f64, NodeId, f64)> = state
        .nodes()
        .map(|node| (distance_to_free_space(&node, place), node.id, node.pose.position.distance(place)))
        .collect();
    let inside: Vec<_> = candidates.iter().filter(|c| c.0 <= 0.0).map(|&(_, id, metres)| (id, metres)).collect();
    if !inside.is_empty() {
        return Ok(inside);
    }
    let nearest_m = candidates.iter().map(|c| c.0).min_by(f64::total_cmp);
    let reachable: Vec<_> = candidates
        .iter()
        .filter(|c| c.0 <= config.max_outside_m)
        .map(|&(_, id, metres)| (id, config.outside_factor * metres))
        .collect();
    if reachable.is_empty() { Err(RouteError::OutOfMap { what, place, nearest_m }) } else { Ok(reachable) }
}

/// Plans a route.
///
/// # Errors
/// [`RouteError`] when a place is out of the map or nothing joins the two.
pub fn plan(state: &MapState, from: FixedPoint, to: FixedPoint, config: &RouteConfig) -> Result<Route, RouteError> {
    let starts = access(state, from, "the start", config)?;
    let ends = access(state, to, "the goal", config)?;
    let end_point = |point| RoutePoint { point, node: None };

    // A rectangle is convex: two places in the same one are joined by a straight line.
    let share_rectangle = state.nodes().any(|node| {
        node.free_space
            .is_some_and(|rect| rect.contains(node.pose.position, from) && rect.contains(node.pose.position, to))
    });
    if share_rectangle {
        return Ok(Route { length_m: from.distance(to), points: vec![end_point(from), end_point(to)] });
    }

    let mut graph = Graph::of(state);
    for edge in &config.blocked {
        graph.remove_edge(*edge);
    }
    let distances = graph.distances(starts);
    let best = ends
        .into_iter()
        .filter_map(|(id, cost_m)| Some((distances.cost_m(id)? + cost_m, id)))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let Some((_, last)) = best else { return Err(RouteError::NoPath { from, to }) };

    let mut points = vec![end_point(from)];
    for id in distances.path_to(last) {
        if let Some(point) = graph.position(id) {
            points.push(RoutePoint { point, node: Some(id) });
        }
    }
    points.push(end_point(to));
    let length_m = points.windows(2).map(|pair| pair[0].point.distance(pair[1].point)).sum();
    Ok(Route { length_m, points })
}
