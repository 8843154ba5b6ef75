//! Shortest paths over nodes and edges (Dijkstra). An edge is as long as its nodes are apart.
//!
//! Lengths are summed in whole micrometres, so that no order of summation and no machine makes a
//! difference.

use crate::crdt::state::MapState;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use pathfinding::directed::dijkstra::{dijkstra, dijkstra_all};
use std::collections::{BTreeMap, BTreeSet};

const UM_PER_M: f64 = 1e6;

/// A length in micrometres. Coordinates are limited to 100 km, so that no sum over a map comes near
/// the limit.
pub(crate) fn to_um(metres: f64) -> u64 {
    (metres * UM_PER_M).round() as u64
}

/// A length in metres.
pub(crate) fn to_metres(um: u64) -> f64 {
    um as f64 / UM_PER_M
}

/// Distance of two points in micrometres.
pub(crate) fn distance_um(a: FixedPoint, b: FixedPoint) -> u64 {
    to_um(a.distance(b))
}

/// The nodes that one unblocked edge leads to from `id`, with the edge's length in micrometres.
pub(crate) fn steps_from<'a>(
    map: &'a MapState,
    id: NodeId,
    blocked: &'a BTreeSet<EdgeKey>,
) -> impl Iterator<Item = (NodeId, u64)> + 'a {
    let from = map.node(id).map(|node| node.pose.position);
    from.into_iter().flat_map(move |from| {
        let open = map.neighbours(id).filter(move |other| !blocked.contains(&EdgeKey::new(id, other.id)));
        open.map(move |other| (other.id, distance_um(from, other.pose.position)))
    })
}

/// The shortest way over edges between two nodes: its length in metres and its nodes, both ends
/// included. `None` if a node is not shown or nothing joins the two.
#[must_use]
pub fn shortest_path(map: &MapState, from: NodeId, to: NodeId) -> Option<(f64, Vec<NodeId>)> {
    map.node(from)?;
    let none = BTreeSet::new();
    let (nodes, length_um) = dijkstra(&from, |&id| steps_from(map, id, &none).collect::<Vec<_>>(), |&id| id == to)?;
    Some((to_metres(length_um), nodes))
}

/// How far every node that can be reached is from `from` over edges, metres; `from` itself at 0.
/// Empty if `from` is not shown.
#[must_use]
pub fn distances_from(map: &MapState, from: NodeId) -> BTreeMap<NodeId, f64> {
    if map.node(from).is_none() {
        return BTreeMap::new();
    }
    let none = BTreeSet::new();
    let reached = dijkstra_all(&from, |&id| steps_from(map, id, &none).collect::<Vec<_>>());
    let mut distances: BTreeMap<NodeId, f64> =
        reached.into_iter().map(|(id, (_, length_um))| (id, to_metres(length_um))).collect();
    distances.insert(from, 0.0);
    distances
}
