//! Nodes by place and by appearance.

use crate::state::{MapState, NodeRef};
use fht_proto::{Descriptor, FixedPoint, NodeId};

/// The nodes within `radius_m` of a place, nearest first, with their distances in metres.
#[must_use]
pub fn nearest(state: &MapState, place: FixedPoint, radius_m: f64) -> Vec<(f64, NodeRef<'_>)> {
    let mut found: Vec<_> = state
        .nodes()
        .map(|node| (node.pose.position.distance(place), node))
        .filter(|(distance, _)| *distance <= radius_m)
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    found
}

/// The main nodes that look most like `descriptor`, best first, at most `count`, with their cosines. Nodes whose
/// descriptor is of another model are left out.
#[must_use]
pub fn most_similar(state: &MapState, descriptor: &Descriptor, count: usize) -> Vec<(NodeId, f32)> {
    let mut found: Vec<(NodeId, f32)> =
        state.main_nodes().filter_map(|node| Some((node.id, node.descriptor()?.similarity(descriptor)?))).collect();
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    found.truncate(count);
    found
}
