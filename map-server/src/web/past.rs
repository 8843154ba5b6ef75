//! An earlier state of a map, as the page draws it: bounded in number, whatever the map.

use crate::catalog::MapView;
use crate::query::{internal, node_view, state_of, written_rules};
use crate::store::IncrementLog;
use crate::web::walls::{Walls, walls};
use fht_proto::FixedPoint;
use fht_proto::api::reply::{ErrorReply, NodeView, RulesReply};
use fht_proto::api::request::Moment;
use serde::Serialize;

/// So many nodes at most.
const MAX_NODES: usize = 20_000;

/// An earlier state.
#[derive(Debug, Serialize)]
pub(super) struct PastReply {
    /// The state's own places, zones and closed edges.
    #[serde(flatten)]
    rules: RulesReply,
    /// The oldest version that is kept.
    oldest: u64,
    nodes: Vec<NodeView>,
    /// What main nodes saw.
    #[serde(flatten)]
    walls: Walls,
}

/// The state of a map at a moment.
///
/// # Errors
/// `UNKNOWN_VERSION` if it is not kept.
pub(super) fn past(view: &MapView, log: &dyn IncrementLog, moment: &Moment) -> Result<PastReply, ErrorReply> {
    let (state, vector) = state_of(view, log, moment)?;
    let floor = log.reader().floor(&view.head.map).map_err(internal)?;
    let mut walls = walls(&state, FixedPoint::default(), f64::INFINITY);
    let nodes: Vec<NodeView> = state.nodes().take(MAX_NODES).map(|node| node_view(&state, &node, None)).collect();
    walls.truncated |= nodes.len() == MAX_NODES;
    let rules = written_rules(&state, &view.head.map, vector.version());
    Ok(PastReply { rules, oldest: floor.version, nodes, walls })
}
