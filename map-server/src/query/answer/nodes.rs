//! `nodes` and `match`: nodes by place and by appearance.

use crate::catalog::{Catalog, MapView};
use crate::query::answer::reply::{Answer, error, json, postcard};
use fht_map::index::lookup;
use fht_map::{FULL_TRUST, MapIndex, MapState, NodeRef};
use fht_proto::api::compact::{CompactNode, CompactNodes, CompactNodesPage};
use fht_proto::api::reply::{ErrorCode, ErrorReply, NodeView, NodesCursor, NodesReply};
use fht_proto::api::request::Format;
use fht_proto::{Descriptor, FixedPoint, NodeId};

/// Maps with more nodes are searched with their index.
const MANY_NODES: usize = 2000;

fn is_large(view: &MapView) -> bool {
    view.head.main_nodes + view.head.support_nodes > MANY_NODES
}

/// Which nodes are asked for.
pub(super) struct NodesQuestion {
    pub(super) near: FixedPoint,
    pub(super) radius_m: f64,
    pub(super) limit: usize,
    pub(super) after: Option<NodesCursor>,
    pub(super) format: Format,
}

impl NodesQuestion {
    /// A page of the nodes within the radius, and where the next one begins.
    fn page<'a>(&self, found: Vec<(NodeRef<'a>, f64)>) -> (Vec<NodeRef<'a>>, Option<NodesCursor>) {
        let cursor = self.after.unwrap_or(NodesCursor::First);
        let keyed = found.into_iter().map(|(node, _)| (NodesCursor::square_mm(node.pose.position, self.near), node));
        let mut nodes: Vec<(u64, NodeRef<'a>)> =
            keyed.filter(|(square_mm, node)| cursor.is_before(*square_mm, node.id)).collect();
        nodes.sort_by_key(|(square_mm, node)| (*square_mm, node.id));
        let is_truncated = nodes.len() > self.limit;
        nodes.truncate(self.limit);
        let next =
            nodes.last().filter(|_| is_truncated).map(|(square_mm, last)| NodesCursor::Behind(*square_mm, last.id));
        (nodes.into_iter().map(|(_, node)| node).collect(), next)
    }
}

pub(super) fn near(view: &MapView, catalog: &Catalog, asked: &NodesQuestion) -> Result<Answer, ErrorReply> {
    let found = |view: &MapView, index: Option<&MapIndex>| {
        let (nodes, next) = asked.page(lookup::nearest(&view.state, index, asked.near, asked.radius_m));
        let nodes: Vec<_> = nodes.into_iter().map(|node| (node, None)).collect();
        let next = next.map(|next| next.to_string());
        match (asked.format, asked.after) {
            (Format::Json, _) => json(&NodesReply { truncated: next.is_some(), next, ..as_json(view, &nodes) }),
            (Format::Postcard, None) => postcard(&as_compact(view, nodes, false)),
            (Format::Postcard, Some(_)) => postcard(&CompactNodesPage { nodes: as_compact(view, nodes, false), next }),
        }
    };
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
        reply(view, matching(&view.state, descriptor, &similar)?, format)
    };
    if !is_large(view) {
        return scanned();
    }
    let over = |view: &MapView, index: &MapIndex| {
        let similar = index.appearance().most_similar(descriptor, limit);
        reply(view, matching(&view.state, descriptor, &similar)?, format)
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

fn reply(view: &MapView, nodes: Vec<(NodeRef<'_>, Option<f32>)>, format: Format) -> Result<Answer, ErrorReply> {
    match format {
        Format::Json => json(&as_json(view, &nodes)),
        Format::Postcard => postcard(&as_compact(view, nodes, true)),
    }
}

/// Nodes, of which there are no more.
fn as_json(view: &MapView, nodes: &[(NodeRef<'_>, Option<f32>)]) -> NodesReply {
    let (map, version) = (view.head.map.clone(), view.head.version);
    let nodes = nodes.iter().map(|(node, similarity)| node_view(&view.state, node, *similarity)).collect();
    NodesReply { map, version, nodes, truncated: false, next: None }
}

fn as_compact(view: &MapView, nodes: Vec<(NodeRef<'_>, Option<f32>)>, with_signatures: bool) -> CompactNodes {
    let (map, version) = (view.head.map.clone(), view.head.version);
    let compact = |(node, similarity): (NodeRef<'_>, Option<f32>)| CompactNode {
        id: node.id,
        kind: node.kind,
        pose: node.pose,
        free_space: node.free_space,
        signature: node.signature.filter(|_| with_signatures).cloned(),
        similarity,
    };
    CompactNodes { map, version, nodes: nodes.into_iter().map(compact).collect() }
}

/// A node as it is shown.
pub(crate) fn node_view(map: &MapState, node: &NodeRef<'_>, similarity: Option<f32>) -> NodeView {
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
