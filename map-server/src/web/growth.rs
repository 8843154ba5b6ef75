//! What has changed on a map since it was shown last, as the page draws it: whole nodes as they are
//! now, so that who gets the same twice has the same.

use crate::catalog::MapView;
use crate::query::node_view;
use fht_map::crdt::diff::{Diff, diff};
use fht_proto::NodeId;
use fht_proto::api::reply::NodeView;
use serde::Serialize;
use std::collections::BTreeSet;

/// If more nodes have changed, the map is to be read anew.
const MAX_NODES: usize = 400;

/// What has changed from one version to another.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Growth {
    /// The version before.
    from: u64,
    /// The version now.
    version: u64,
    /// Nodes that are new or not what they were, and those at the other ends of edges that are.
    nodes: Vec<NodeView>,
    /// Nodes that are not there any more.
    gone: Vec<String>,
    /// Whether places, zones, closed edges, releases or what is blocked have changed.
    rules: bool,
    /// Whether too much has changed to be told: everything is to be read anew.
    reload: bool,
}

/// What has changed from `before` to `now`.
pub(super) fn growth(before: &MapView, now: &MapView) -> Growth {
    let Diff { added, removed, moved, changed, added_edges, removed_edges, closed_edges, opened_edges, annotations } =
        diff(&before.state, &now.state);
    let moved = moved.into_iter().map(|(id, _)| id);
    let ends = added_edges.iter().chain(&removed_edges).flat_map(|edge| [edge.low(), edge.high()]);
    let touched: BTreeSet<NodeId> = added.into_iter().chain(moved).chain(changed).chain(ends).collect();
    let cleared = before.head.reports_cleared != now.head.reports_cleared;
    let rules = cleared || !(closed_edges.is_empty() && opened_edges.is_empty() && annotations.is_empty());
    let (from, version) = (before.head.version, now.head.version);
    if touched.len() + removed.len() > MAX_NODES {
        return Growth { from, version, nodes: Vec::new(), gone: Vec::new(), rules, reload: true };
    }
    let shown = touched.iter().filter_map(|id| now.state.node(*id));
    let nodes = shown.map(|node| node_view(&now.state, &node, None)).collect();
    let gone = removed.iter().map(ToString::to_string).collect();
    Growth { from, version, nodes, gone, rules, reload: false }
}
