//! Nodes by place and by appearance.

use crate::crdt::state::{MapState, NodeRef};
use crate::index::map_index::MapIndex;
use fht_proto::{Descriptor, FixedPoint, NodeId};

/// The nodes within `radius_m` of `point`, nearest first, with their distances in metres. Equal
/// distances are ordered by id. `index`, which must be that of `map`, makes it fast on a large map
/// and changes nothing else.
#[must_use]
pub fn nearest<'a>(
    map: &'a MapState,
    index: Option<&MapIndex>,
    point: FixedPoint,
    radius_m: f64,
) -> Vec<(NodeRef<'a>, f64)> {
    let nodes: Vec<NodeRef<'a>> = match index {
        None => map.nodes().collect(),
        // A node is in its rectangle, so a node that stands near has a rectangle that comes near.
        Some(index) => {
            let numbers = index.places().within(point, radius_m).into_iter();
            numbers.filter_map(|number| map.node(index.roads().id(number)?)).collect()
        }
    };
    let with_distance = nodes.into_iter().map(|node| (node, node.pose.position.distance(point)));
    let mut near: Vec<_> = with_distance.filter(|&(_, distance)| distance <= radius_m).collect();
    near.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.id.cmp(&b.0.id)));
    near
}

/// The `k` main nodes whose descriptors are most like `descriptor`, most similar first, with the
/// cosines: the best matches of the paper's equation 8. Descriptors of other models are passed
/// over. Equal cosines are ordered by id.
/// [`DescriptorIndex`](crate::index::descriptors::DescriptorIndex) gives the same answer sooner.
#[must_use]
pub fn most_similar(map: &MapState, descriptor: &Descriptor, k: usize) -> Vec<(NodeId, f32)> {
    let with_cosine = map.main_nodes().filter_map(|node| Some((node.id, node.descriptor()?.similarity(descriptor)?)));
    let mut similar: Vec<_> = with_cosine.collect();
    similar.sort_by(|a, b| b.1.total_cmp(&a.1)); // stable
    similar.truncate(k);
    similar
}
