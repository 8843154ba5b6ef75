//! `nodes` and `match`: nodes by place and by appearance.

use crate::catalog::{Catalog, MapView};
use crate::query::answer::reply::{Answer, error, json, postcard};
use fht_map::index::lookup;
use fht_map::{FULL_TRUST, MapIndex, MapState, NodeRef};
use fht_proto::api::compact::{CompactNode, CompactNodes};
use fht_proto::api::reply::{ErrorCode, ErrorReply, NodeView, NodesReply};
use fht_proto::api::request::Format;
use fht_proto::{Descriptor, FixedPoint, NodeId};

/// Maps with more nodes are searched with their index.
const MANY_NODES: usize = 2000;

fn is_large(view: &MapView) -> bool {
    view.head.main_nodes + view.head.support_nodes > MANY_NODES
}

pub(super) fn near(
    view: &MapView,
    catalog: &Catalog,
    near: FixedPoint,
    radius_m: f64,
    limit: usize,
    format: Format,
) -> Result<Answer, ErrorReply> {
    let reply = |view: &MapView, near: Vec<(NodeRef<'_>, f64)>| {
        let nodes = near.into_iter().take(limit).map(|(node, _)| (node, None)).collect();
        reply(view, nodes, format, false)
    };
    let found =
        |view: &MapView, index: Option<&MapIndex>| reply(view, lookup::nearest(&view.state, index, near, radius_m));
    if !is_large(view) {
        return found(view, None);
    }
    catalog.with_index(&view.head.map, |view, index| found(view, Some(index))).unwrap_or_else(|| found(view, None))
}

pub(super) fn alike(
    view: &MapView,
    catalog: &Catalog,
    descriptor: &Descriptor,
    limit: usize,
    format: Format,
) -> Result<Answer, ErrorReply> {
    let scanned = || {
        let similar = lookup::most_similar(&view.state, descriptor, limit);
        reply(view, matching(&view.state, descriptor, &similar)?, format, true)
    };
    if !is_large(view) {
        return scanned();
    }
    let over = |view: &MapView, index: &MapIndex| {
        let similar = index.appearance().most_similar(descriptor, limit);
        reply(view, matching(&view.state, descriptor, &similar)?, format, true)
    };
    catalog.with_index(&view.head.map, over).unwrap_or_else(scanned)
}

/// The most similar nodes with their cosine similarities.
fn matching<'a>(
    map: &'a MapState,
    descriptor: &Descriptor,
    similar: &[(NodeId, f32)],
) -> Result<Vec<(NodeRef<'a>, Option<f32>)>, ErrorReply> {
    if similar.is_empty() && map.main_nodes().any(|node| node.descriptor().is_some()) {
        let used: Vec<String> = map.models().map(|model| format!("{} ({:08x})", model.name, model.id.0)).collect();
        let text = format!(
            "the descriptor is of model {:08x} with {} numbers; this map uses: {}",
            descriptor.model.0,
            descriptor.values.len(),
            used.join(", ")
        );
        return Err(error(ErrorCode::IncompatibleModel, text));
    }
    Ok(similar.iter().filter_map(|&(id, cosine)| Some((map.node(id)?, Some(cosine)))).collect())
}

fn reply(
    view: &MapView,
    nodes: Vec<(NodeRef<'_>, Option<f32>)>,
    format: Format,
    with_signatures: bool,
) -> Result<Answer, ErrorReply> {
    let (map, version) = (view.head.map.clone(), view.head.version);
    match format {
        Format::Json => {
            let nodes = nodes.iter().map(|(node, similarity)| node_view(&view.state, node, *similarity)).collect();
            json(&NodesReply { map, version, nodes })
        }
        Format::Postcard => {
            let compact = |(node, similarity): (NodeRef<'_>, Option<f32>)| CompactNode {
                id: node.id,
                kind: node.kind,
                pose: node.pose,
                free_space: node.free_space,
                signature: node.signature.filter(|_| with_signatures).cloned(),
                similarity,
            };
            postcard(&CompactNodes { map, version, nodes: nodes.into_iter().map(compact).collect() })
        }
    }
}

fn node_view(map: &MapState, node: &NodeRef<'_>, similarity: Option<f32>) -> NodeView {
    let position = node.pose.position;
    NodeView {
        id: node.id.to_string(),
        kind: node.kind,
        x: position.x(),
        y: position.y(),
        yaw: node.pose.yaw(),
        free_space: node.free_space.map(|rect| NodeView::corners(position, &rect)),
        neighbours: map.neighbours(node.id).map(|other| other.id.to_string()).collect(),
        similarity,
        trust: (node.trust != FULL_TRUST).then_some(node.trust),
    }
}
