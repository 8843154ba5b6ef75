//! Nodes by place and by appearance.

use crate::map_index::MapIndex;
use crate::state::{MapState, NodeRef};
use fht_proto::{Descriptor, FixedPoint, NodeId};

/// The nodes within `radius_m` of `point`, nearest first, with their distances in metres. Equal distances are ordered by
/// id.
#[must_use]
pub fn nearest(map: &MapState, point: FixedPoint, radius_m: f64) -> Vec<(NodeRef<'_>, f64)> {
    let with_distance = map.nodes().map(|node| (node, node.pose.position.distance(point)));
    let mut near: Vec<_> = with_distance.filter(|&(_, distance)| distance <= radius_m).collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1)); // stable: the nodes come in the order of their ids
    near
}

/// As [`nearest`], over the map's index: fast on a large map. `index` must be that of `map`.
#[must_use]
pub fn nearest_over<'a>(
    map: &'a MapState,
    index: &MapIndex,
    point: FixedPoint,
    radius_m: f64,
) -> Vec<(NodeRef<'a>, f64)> {
    // A node is in its rectangle, so whoever stands near has a rectangle that comes near.
    let numbers = index.places().within(point, radius_m).into_iter();
    let nodes = numbers.filter_map(|number| map.node(index.roads().id(number)?));
    let with_distance = nodes.map(|node| (node, node.pose.position.distance(point)));
    let mut near: Vec<_> = with_distance.filter(|&(_, distance)| distance <= radius_m).collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.id.cmp(&b.0.id)));
    near
}

/// The `k` main nodes whose descriptors are most like `descriptor`, most similar first, with the cosines. Descriptors of
/// other models are passed over. Equal cosines are ordered by id. [`Appearance`](crate::appearance::Appearance) gives the
/// same answer sooner.
#[must_use]
pub fn most_similar(map: &MapState, descriptor: &Descriptor, k: usize) -> Vec<(NodeId, f32)> {
    let with_cosine = map.main_nodes().filter_map(|node| Some((node.id, node.descriptor()?.similarity(descriptor)?)));
    let mut similar: Vec<_> = with_cosine.collect();
    similar.sort_by(|a, b| b.1.total_cmp(&a.1)); // stable
    similar.truncate(k);
    similar
}
