//! Edges: straight lines that a robot can drive (paper, section III-B-3, equation 7).

use super::point;
use fht_map::MapState;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use fht_robot::grid::OccupancyGrid;
use fht_robot::pose::wrap_angle;

/// Parameters of the edges.
#[derive(Clone, Debug)]
pub struct EdgeConfig {
    /// Longest edge, metres. Default 8 (facts §1.3).
    pub longest_m: f64,
    /// Every cell whose centre lies within this of an edge must be known to be free, metres. Default 0.165: an occupied
    /// cell's centre is farther than that, and its nearest point farther than that less half a cell's diagonal (0.035 m
    /// for cells of 0.05 m), so 0.13 m are clear on either side: the radius of the paper's robot and half a cell, by which a
    /// corner of a wall may stand out of its occupied cells. Planners take edges to be that wide.
    pub half_width_m: f64,
    /// Of edges whose directions differ by less than this, only the shortest is kept, radians. Default 0.5 (facts
    /// §1.3; nearest first, where the paper's code takes the newest first).
    pub bearing_gap_rad: f64,
    /// An existing edge is removed when something stands within this of it, metres. Less than the half width, so that
    /// a wall that wavers by a cell does not make edges come and go. Default 0.1.
    pub blocked_m: f64,
    /// The same for edges of nodes that other robots made, metres: their walls are off by a little from where this robot sees
    /// them. Default 0.05.
    pub blocked_told_m: f64,
}

impl Default for EdgeConfig {
    fn default() -> Self {
        Self { longest_m: 8.0, half_width_m: 0.165, bearing_gap_rad: 0.5, blocked_m: 0.1, blocked_told_m: 0.05 }
    }
}

/// Nodes within `radius_m` of a place, nearest first: distance, id, position.
#[must_use]
pub fn nearby_nodes(state: &MapState, here: FixedPoint, radius_m: f64) -> Vec<(f64, NodeId, FixedPoint)> {
    let mut nearby: Vec<_> = state
        .nodes()
        .map(|node| (node.pose.position.distance(here), node.id, node.pose.position))
        .filter(|&(distance, ..)| distance <= radius_m)
        .collect();
    nearby.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    nearby
}

/// The edges of a new node `id` at `here` to nodes of the map.
#[must_use]
pub fn edges_of(
    state: &MapState,
    grid: &OccupancyGrid,
    id: NodeId,
    here: FixedPoint,
    config: &EdgeConfig,
) -> Vec<EdgeKey> {
    let mut bearings: Vec<f64> = Vec::new();
    let mut edges = Vec::new();
    for (_, other, position) in nearby_nodes(state, here, config.longest_m) {
        let bearing = (position.y() - here.y()).atan2(position.x() - here.x());
        let is_covered = bearings.iter().any(|&taken| wrap_angle(taken - bearing).abs() < config.bearing_gap_rad);
        if other == id || is_covered {
            continue;
        }
        if grid.is_corridor_free(point(here), point(position), config.half_width_m) {
            bearings.push(bearing);
            edges.push(EdgeKey::new(id, other));
        }
    }
    edges
}

/// Whether something stands on an edge of the map by now. `is_own` says which nodes this robot made.
#[must_use]
pub fn is_blocked(
    state: &MapState,
    grid: &OccupancyGrid,
    edge: EdgeKey,
    is_own: impl Fn(NodeId) -> bool,
    config: &EdgeConfig,
) -> bool {
    let (Some(a), Some(b)) = (state.node(edge.low()), state.node(edge.high())) else { return false };
    let half_m = if is_own(a.id) && is_own(b.id) { config.blocked_m } else { config.blocked_told_m };
    !grid.is_corridor_unoccupied(point(a.pose.position), point(b.pose.position), half_m)
}

/// Edges of the map that something stands on by now. `is_own` says which nodes this robot made.
#[must_use]
pub fn blocked(
    state: &MapState,
    grid: &OccupancyGrid,
    is_own: impl Fn(NodeId) -> bool,
    config: &EdgeConfig,
) -> Vec<EdgeKey> {
    state.edges().filter(|edge| is_blocked(state, grid, *edge, &is_own, config)).collect()
}
