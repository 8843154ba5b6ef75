//! The operations that bring one map into the other.
//!
//! | module | idea |
//! | --- | --- |
//! | `joint_grid` | both maps on one grid |
//! | `coverage` | which ground rectangles cover |
//! | `node_selection` | which nodes of the second map are of use |
//! | `stitch` | how they hang together, and on the first map |
//! | `rules` | places, zones and closed edges |

mod coverage;
mod joint_grid;
mod node_selection;
mod rules;
mod stitch;

pub use joint_grid::JointGridConfig;
pub use node_selection::NodeSelectionConfig;

use crate::alignment::Alignment;
use crate::config::MergeConfig;
use crate::refusal::MergeRefusal;
use fht_map::{FULL_TRUST, MapState};
use fht_perception::pose::to_fixed;
use fht_proto::{AuthorId, EdgeKey, Increment, NodeId, NodeKind, Op};
use joint_grid::draw;
use node_selection::{Kept, keep};
use rules::carry;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use stitch::{Joiner, Joints};

/// What is to be written, and by whom.
#[derive(Clone, Copy, Debug)]
pub struct MergeOptions<'a> {
    /// The author of the new nodes.
    pub author: AuthorId,
    /// Added to names of the second map that the first one has, too; 1 to 32 letters and digits.
    pub suffix: &'a str,
    /// Leave out what operators wrote: places, zones, closed edges.
    pub only_map: bool,
}

/// What brings the second map into the first.
#[derive(Clone, Debug)]
pub struct MergedOperations {
    /// Operations, in batches of sensible length; each is one increment. What they refer to comes
    /// in the same one or before.
    pub batches: Vec<Vec<Op>>,
    /// How much it is.
    pub figures: MergeFigures,
}

/// How much of the second map is new.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MergeFigures {
    /// Nodes of the second map.
    pub nodes: usize,
    /// Main nodes taken over.
    pub main_nodes: usize,
    /// Support nodes taken over.
    pub support_nodes: usize,
    /// Nodes with something new that no way leads to.
    pub left_out: usize,
    /// Edges taken over.
    pub edges: usize,
    /// Edges between the first map's nodes and those taken over.
    pub joining_edges: usize,
    /// Closed edges taken over.
    pub closed_edges: usize,
    /// Places and zones taken over.
    pub annotations: usize,
    /// Old and new names of those whose name was taken.
    pub renamed: Vec<[String; 2]>,
}

/// What a batch takes up in memory, about, bytes: some ten thousand on the wire.
const BATCH_BYTES: usize = 24 << 10;

/// Brings `b`, as it was laid, into `a`.
///
/// # Errors
/// [`MergeRefusal`]: no way leads from the one to the other, or it is too large.
pub fn join(
    a: &MapState,
    b: &MapState,
    laid: &Alignment,
    order: &MergeOptions<'_>,
    config: &MergeConfig,
) -> Result<MergedOperations, MergeRefusal> {
    let grid = draw(a, b, &laid.a_from_nodes, &config.edges, &config.joint)?;
    let closed: BTreeSet<EdgeKey> = if order.only_map { BTreeSet::new() } else { b.closed_edges().collect() };
    // What closes a passage has to be there.
    let must = |id: NodeId| closed.iter().any(|edge| edge.low() == id || edge.high() == id);
    let mut kept = keep(a, b, &laid.a_from_nodes, &grid, must, &config.keep);
    let joiner =
        Joiner { a, b, a_from_nodes: &laid.a_from_nodes, grid: &grid, edges: &config.edges, keep: &config.keep };
    let joints = joiner.join(&mut kept);
    if kept.is_empty() && joints.left_out > 0 {
        return Err(MergeRefusal::NoWay);
    }
    Ok(write(a, b, laid, order, &kept, joints, &closed))
}

fn write(
    a: &MapState,
    b: &MapState,
    laid: &Alignment,
    order: &MergeOptions<'_>,
    kept: &BTreeMap<NodeId, Kept>,
    mut joints: Joints,
    closed: &BTreeSet<EdgeKey>,
) -> MergedOperations {
    let first = a.next_number(order.author);
    let new: BTreeMap<NodeId, NodeId> =
        (first..).zip(kept.keys()).map(|(number, id)| (*id, NodeId { author: order.author, number })).collect();
    let renamed = |edge: &EdgeKey| Some(EdgeKey::new(*new.get(&edge.low())?, *new.get(&edge.high())?));
    // What is closed stays an edge, whatever stands on it.
    joints.own.extend(closed.iter().filter(|edge| renamed(edge).is_some()));
    let mut figures =
        MergeFigures { nodes: laid.a_from_nodes.len(), left_out: joints.left_out, ..MergeFigures::default() };
    let mut batches = Batches::default();
    let known: BTreeSet<_> = a.models().map(|model| model.id).collect();
    for model in b.models().filter(|model| !known.contains(&model.id)) {
        batches.push(vec![Op::PutModel { model: model.clone() }]);
    }
    for (old, one) in kept {
        let id = new[old];
        let Some(node) = b.node(*old) else { continue };
        let mut ops = vec![Op::PutNode { id, kind: one.kind, pose: to_fixed(&one.a_from_node) }];
        if one.kind == NodeKind::Main
            && let Some(signature) = node.signature
        {
            ops.push(Op::SetSignature { id, signature: signature.clone() });
        }
        ops.extend(one.free_space.map(|rect| Op::SetFreeSpace { id, rect: Some(rect) }));
        if node.trust != FULL_TRUST {
            ops.push(Op::SetTrust { id, percent: node.trust });
        }
        *(if one.kind == NodeKind::Main { &mut figures.main_nodes } else { &mut figures.support_nodes }) += 1;
        batches.push(ops);
    }
    for edge in joints.own.iter().filter_map(renamed) {
        figures.edges += 1;
        batches.push(vec![Op::PutEdge { edge }]);
    }
    for (one, other) in &joints.across {
        figures.joining_edges += 1;
        batches.push(vec![Op::PutEdge { edge: EdgeKey::new(new[one], *other) }]);
    }
    for edge in closed.iter().filter_map(renamed) {
        figures.closed_edges += 1;
        batches.push(vec![Op::SetClosed { edge, closed: true }]);
    }
    if !order.only_map {
        let carried = carry(a, b, &laid.a_from_b, order.suffix);
        (figures.annotations, figures.renamed) = (carried.count, carried.renamed);
        carried.ops.into_iter().for_each(|op| batches.push(vec![op]));
    }
    MergedOperations { batches: batches.done, figures }
}

/// Operations in batches.
#[derive(Default)]
struct Batches {
    done: Vec<Vec<Op>>,
    bytes: usize,
}

impl Batches {
    /// Adds operations that belong together.
    fn push(&mut self, ops: Vec<Op>) {
        let more: usize = ops.iter().map(Op::memory_bytes).sum();
        let is_full = |last: &Vec<Op>| self.bytes + more > BATCH_BYTES || last.len() + ops.len() > Increment::MAX_OPS;
        if self.done.last().is_none_or(is_full) {
            self.done.push(Vec::new());
            self.bytes = 0;
        }
        self.bytes += more;
        if let Some(last) = self.done.last_mut() {
            last.extend(ops);
        }
    }
}
