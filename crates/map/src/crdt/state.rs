//! The state of a map: the join of its increments.
//!
//! Every element is a last-writer-wins register, and a removal is a tombstone that keeps its stamp.
//! Therefore applying increments is commutative, associative and idempotent:
//!
//! * A node is shown if its newest `PutNode` is newer than its newest `RemoveNode`. Its kind comes
//!   from the newest `PutNode`, its pose from the newest of `PutNode` and `SetPose`, free space and
//!   signature from their own writes.
//! * Writes to a node that are not newer than its newest removal do not count, whether they arrive
//!   before or after it.
//! * An edge is shown if its newest write is a `PutEdge` and both its nodes are shown. It comes
//!   back with them. Whether it is closed is a write of its own, which no put or removal of the
//!   edge touches.
//!
//! Nodes and edges are kept in leaves ([`crate::crdt::leaf`]) that copies of a map share until one
//! of them changes: a copy costs as many pointers as there are leaves, and digest and counts follow
//! from what has changed since they were last asked for.

use crate::crdt::annotations::Annotations;
use crate::crdt::leaf::{EdgeState, Leaf, LeafKey, NodeState, Shared, leaf_of};
use crate::crdt::register::{ContentHash, Register, content_hash, join_into};
use fht_proto::{
    AuthorId, CompactedSeries, Descriptor, DescriptorModel, Digest, EdgeKey, FixedPose, Increment, NodeId, NodeKind,
    Op, Rect, Signature, Stamp,
};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A node that is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeRef<'a> {
    /// Its id.
    pub id: NodeId,
    /// Main or support.
    pub kind: NodeKind,
    /// Its pose in the map frame.
    pub pose: FixedPose,
    /// Its rectangle of free space, relative to its position.
    pub free_space: Option<Rect>,
    /// Descriptor and scan (main nodes).
    pub signature: Option<&'a Signature>,
    /// How far it is believed, 0 to 100.
    pub trust: u8,
}

/// Trust in what nobody has doubted.
pub const FULL_TRUST: u8 = 100;

/// The node if it is shown. A node with a kind has a pose too: `PutNode` writes both.
fn shown(id: NodeId, node: &NodeState) -> Option<NodeRef<'_>> {
    Some(NodeRef {
        id,
        kind: node.shown_kind()?,
        pose: *node.pose.as_ref()?.value(),
        free_space: node.free_space.as_ref().and_then(|register| *register.value()),
        signature: node.signature.as_ref().map(|register| register.value().signature()),
        trust: node.trust.as_ref().map_or(FULL_TRUST, |register| *register.value()),
    })
}

impl<'a> NodeRef<'a> {
    /// Its visual descriptor, if it has one.
    #[must_use]
    pub fn descriptor(&self) -> Option<&'a Descriptor> {
        self.signature.and_then(|signature| signature.descriptor.as_ref())
    }
}

/// How much of what is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Main nodes.
    pub main_nodes: usize,
    /// Support nodes.
    pub support_nodes: usize,
    /// Edges.
    pub edges: usize,
}

/// A map: what a set of increments adds up to. Copies share what neither has changed.
#[derive(Clone, Debug, Default)]
pub struct MapState {
    leaves: BTreeMap<LeafKey, Arc<Leaf>>,
    annotations: Arc<Annotations>,
    max_hlc_us: u64,
    // Follow from the leaves.
    counts: Counts,
    elements: usize,
}

impl MapState {
    /// The empty map.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Joins an increment into the map. Order and repetition do not matter. The increment must have
    /// passed validation (everything from [`fht_proto::decode`] has).
    pub fn apply(&mut self, increment: &Increment) {
        self.max_hlc_us = self.max_hlc_us.max(increment.hlc_us);
        for (stamp, op) in increment.stamped() {
            self.apply_op(increment.number, stamp, op);
        }
    }

    /// Joins what is left of old increments into the map: like [`apply`](Self::apply).
    pub fn apply_fold(&mut self, fold: &CompactedSeries) {
        for (stamp, number, op) in fold.stamped() {
            self.max_hlc_us = self.max_hlc_us.max(stamp.hlc_us);
            self.apply_op(number, stamp, op);
        }
    }

    fn apply_op(&mut self, number: u64, stamp: Stamp, op: &Op) {
        match op {
            Op::PutNode { id, kind, pose } => self.write(*id, stamp, |node| {
                join_into(&mut node.kind, Register::new(stamp, *kind));
                join_into(&mut node.pose, Register::new(stamp, *pose));
            }),
            Op::RemoveNode { id } => self.change_node(*id, |node| node.remove(stamp)),
            Op::SetPose { id, pose } => {
                self.write(*id, stamp, |node| join_into(&mut node.pose, Register::new(stamp, *pose)));
            }
            Op::SetFreeSpace { id, rect } => {
                self.write(*id, stamp, |node| join_into(&mut node.free_space, Register::new(stamp, *rect)));
            }
            Op::SetSignature { id, signature } => self.write(*id, stamp, |node| {
                join_into(&mut node.signature, Register::new(stamp, Shared::new(signature.clone())));
            }),
            Op::SetTrust { id, percent } => {
                self.write(*id, stamp, |node| node.set_trust(Register::new(stamp, *percent)));
            }
            Op::PutEdge { edge } => self.change_edge(*edge, |state| state.put(Register::new(stamp, true))),
            Op::RemoveEdge { edge } => self.change_edge(*edge, |state| state.put(Register::new(stamp, false))),
            Op::SetClosed { edge, closed } => {
                self.change_edge(*edge, |state| state.close(Register::new(stamp, *closed)));
            }
            Op::PutModel { .. }
            | Op::SetPlace { .. }
            | Op::SetZone { .. }
            | Op::PutRelease { .. }
            | Op::RemoveRelease { .. }
            | Op::Enable { .. }
            | Op::SetFloorPlan { .. }
            | Op::SetDatum { .. } => Arc::make_mut(&mut self.annotations).apply(number, stamp, op),
        }
    }

    fn write(&mut self, id: NodeId, stamp: Stamp, write: impl FnOnce(&mut NodeState)) {
        self.change_node(id, |node| {
            if node.outlives_removal(stamp) {
                write(node);
            }
        });
    }

    fn leaf_mut(&mut self, id: NodeId) -> &mut Leaf {
        Arc::make_mut(self.leaves.entry(leaf_of(id)).or_default())
    }

    fn change_node(&mut self, id: NodeId, change: impl FnOnce(&mut NodeState)) {
        let (node, is_new) = self.leaf_mut(id).node_mut(id.number);
        let before = node.shown_kind();
        change(node);
        let after = node.shown_kind();
        self.elements += usize::from(is_new);
        if before == after {
            return;
        }
        let count = |counts: &mut Counts, kind: NodeKind, by: isize| {
            let of_kind = if kind == NodeKind::Main { &mut counts.main_nodes } else { &mut counts.support_nodes };
            *of_kind = of_kind.saturating_add_signed(by);
        };
        before.into_iter().for_each(|kind| count(&mut self.counts, kind, -1));
        after.into_iter().for_each(|kind| count(&mut self.counts, kind, 1));
        if before.is_some() != after.is_some() {
            // Its edges come and go with it.
            let others = self.adjacent(id).filter(|&other| self.is_shown(other)).count().cast_signed();
            let by = if after.is_some() { others } else { -others };
            self.counts.edges = self.counts.edges.saturating_add_signed(by);
        }
    }

    fn change_edge(&mut self, edge: EdgeKey, change: impl FnOnce(&mut EdgeState)) {
        let (state, is_new) = self.leaf_mut(edge.low()).edge_mut(edge);
        let was_put = state.is_put();
        change(state);
        let is_put = state.is_put();
        self.elements += usize::from(is_new);
        if was_put == is_put {
            return;
        }
        for (end, other) in [(edge.low(), edge.high()), (edge.high(), edge.low())] {
            self.leaf_mut(end).set_adjacent(end.number, other, is_put);
        }
        if self.is_shown(edge.low()) && self.is_shown(edge.high()) {
            self.counts.edges = self.counts.edges.saturating_add_signed(if is_put { 1 } else { -1 });
        }
    }

    /// BLAKE3 hash of the canonical form: all that was written to nodes, edges and annotations,
    /// with stamps, tombstones included, leaf by leaf. Maps with equal digests are equal now, and
    /// stay equal under equal increments.
    #[must_use]
    pub fn digest(&self) -> Digest {
        /// Format of the canonical form, so that a later one cannot be mistaken for this one.
        const FORMAT: &str = "fht-map state 2";
        // A leaf that only knows of edges which begin elsewhere says nothing that those do not say.
        let leaves: Vec<(&LeafKey, ContentHash)> =
            self.leaves.iter().filter(|(_, leaf)| !leaf.is_empty()).map(|(key, leaf)| (key, leaf.digest())).collect();
        Digest(content_hash(&(FORMAT, leaves, self.annotations.digest())))
    }

    /// The newest hybrid logical clock that was applied, microseconds; 0 in the empty map. A writer
    /// stamps with more.
    #[must_use]
    pub fn max_hlc_us(&self) -> u64 {
        self.max_hlc_us
    }

    /// The least number that no node of this author has ever had, as far as this map knows.
    #[must_use]
    pub fn next_number(&self, author: AuthorId) -> u32 {
        let leaves = self.leaves.range((author, 0)..=(author, u32::MAX)).rev();
        leaves
            .filter_map(|(_, leaf)| leaf.nodes().last())
            .map(|(number, _)| number.saturating_add(1))
            .next()
            .unwrap_or(0)
    }

    pub(crate) fn all_nodes(&self) -> impl Iterator<Item = (NodeId, &NodeState)> {
        self.leaves
            .iter()
            .flat_map(|(&(author, _), leaf)| leaf.nodes().map(move |(number, node)| (NodeId { author, number }, node)))
    }

    /// The nodes shown, in the order of their ids.
    pub fn nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.all_nodes().filter_map(|(id, node)| shown(id, node))
    }

    /// The main nodes shown, in the order of their ids.
    pub fn main_nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.nodes().filter(|node| node.kind == NodeKind::Main)
    }

    pub(crate) fn node_state(&self, id: NodeId) -> Option<&NodeState> {
        self.leaves.get(&leaf_of(id)).and_then(|leaf| leaf.node(id.number))
    }

    /// The node, if it is shown.
    #[must_use]
    pub fn node(&self, id: NodeId) -> Option<NodeRef<'_>> {
        self.node_state(id).and_then(|node| shown(id, node))
    }

    fn all_edges(&self) -> impl Iterator<Item = (EdgeKey, &EdgeState)> {
        self.leaves.iter().flat_map(|(&(author, _), leaf)| {
            leaf.edges().map(move |(number, high, edge)| (EdgeKey::new(NodeId { author, number }, high), edge))
        })
    }

    /// The edges shown, in the order of their keys.
    pub fn edges(&self) -> impl Iterator<Item = EdgeKey> + '_ {
        let put = self.all_edges().filter(|(_, state)| state.is_put()).map(|(edge, _)| edge);
        put.filter(|edge| self.is_shown(edge.low()) && self.is_shown(edge.high()))
    }

    /// The edges shown that an operator has closed, in the order of their keys.
    pub fn closed_edges(&self) -> impl Iterator<Item = EdgeKey> + '_ {
        let closed = self.all_edges().filter(|(_, state)| state.is_put() && state.is_closed()).map(|(edge, _)| edge);
        closed.filter(|edge| self.is_shown(edge.low()) && self.is_shown(edge.high()))
    }

    /// Whether an edge is shown.
    #[must_use]
    pub fn has_edge(&self, edge: EdgeKey) -> bool {
        let state = self.leaves.get(&leaf_of(edge.low())).and_then(|leaf| leaf.edge(edge));
        state.is_some_and(EdgeState::is_put) && self.is_shown(edge.low()) && self.is_shown(edge.high())
    }

    fn adjacent(&self, id: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        self.leaves.get(&leaf_of(id)).into_iter().flat_map(move |leaf| leaf.adjacent(id.number))
    }

    /// The nodes shown that an edge joins to `id`, in the order of their ids; none if `id` is not
    /// shown.
    pub fn neighbours(&self, id: NodeId) -> impl Iterator<Item = NodeRef<'_>> {
        let adjacent = self.is_shown(id).then(|| self.adjacent(id));
        adjacent.into_iter().flatten().filter_map(|other| self.node(other))
    }

    /// Named places, zones, releases, descriptor models.
    #[must_use]
    pub fn annotations(&self) -> &Annotations {
        &self.annotations
    }

    /// The descriptor models used, in the order of their ids.
    pub fn models(&self) -> impl Iterator<Item = &DescriptorModel> {
        self.annotations.models()
    }

    /// How many nodes and edges are shown.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// How many nodes, edges and annotations take up memory, removed ones included.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.elements + self.annotations.count()
    }

    /// How many of the [elements](Self::elements) are there for whom: whoever put each, or else
    /// wrote to it last. Looks at all of the map.
    #[must_use]
    pub fn elements_by_writer(&self) -> BTreeMap<AuthorId, usize> {
        let nodes = self.all_nodes().filter_map(|(_, node)| node.writer());
        let edges = self.all_edges().filter_map(|(_, edge)| edge.writer());
        let mut counts = BTreeMap::new();
        for writer in nodes.chain(edges).chain(self.annotations.writers()) {
            *counts.entry(writer).or_default() += 1;
        }
        counts
    }

    fn is_shown(&self, id: NodeId) -> bool {
        self.node_state(id).is_some_and(|node| node.kind.is_some())
    }
}
