//! Edges: straight lines that a robot can drive (paper, section III-B-3, equation 7).

use super::point;
use fht_map::MapState;
pub use fht_perception::drivable_line::DrivableLineConfig;
use fht_perception::drivable_line::lines_to;
use fht_perception::grid::OccupancyGrid;
use fht_proto::{EdgeKey, FixedPoint, NodeId};

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
    config: &DrivableLineConfig,
) -> Vec<EdgeKey> {
    let others = nearby_nodes(state, here, config.longest_m).into_iter().filter(|(_, other, _)| *other != id);
    lines_to(grid, here, others, config).into_iter().map(|other| EdgeKey::new(id, other)).collect()
}

/// Whether something stands on an edge of the map by now. `is_own` says which nodes this robot
/// made.
#[must_use]
pub fn is_blocked(
    state: &MapState,
    grid: &OccupancyGrid,
    edge: EdgeKey,
    is_own: impl Fn(NodeId) -> bool,
    config: &DrivableLineConfig,
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
    config: &DrivableLineConfig,
) -> Vec<EdgeKey> {
    state.edges().filter(|edge| is_blocked(state, grid, *edge, &is_own, config)).collect()
}
