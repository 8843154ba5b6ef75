//! The state of a map: the join of its increments.
//!
//! Every element is a last-writer-wins register, and a removal is a tombstone that keeps its stamp. Therefore applying
//! increments is commutative, associative and idempotent:
//!
//! * A node is shown if its newest `PutNode` is newer than its newest `RemoveNode`. Its kind comes from the newest
//!   `PutNode`, its pose from the newest of `PutNode` and `SetPose`, free space and signature from their own writes.
//! * Writes to a node that are not newer than its newest removal do not count, whether they arrive before or after it.
//! * An edge is shown if its newest write is a `PutEdge` and both its nodes are shown. It comes back with them.

use crate::register::{ContentHash, Register, content_hash, join_into};
use fht_proto::{
    Descriptor, DescriptorModel, Digest, EdgeKey, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect, Signature,
    Stamp,
};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// What is known of one node, shown or not.
#[derive(Clone, Debug, Default, Serialize)]
struct NodeState {
    removed: Option<Stamp>,
    kind: Option<Register<NodeKind>>,
    pose: Option<Register<FixedPose>>,
    free_space: Option<Register<Option<Rect>>>,
    // Shared, so that a copy of a map does not copy its descriptors and scans.
    signature: Option<Register<Shared<Signature>>>,
}

/// A value behind an `Arc` that is serialised like the value itself.
#[derive(Clone, Debug)]
struct Shared<T>(Arc<T>);

impl<T: Serialize> Serialize for Shared<T> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

fn clear_up_to<T: Serialize>(slot: &mut Option<Register<T>>, removed: Stamp) {
    if slot.as_ref().is_some_and(|register| register.stamp() <= removed) {
        *slot = None;
    }
}

impl NodeState {
    fn outlives_removal(&self, stamp: Stamp) -> bool {
        self.removed.is_none_or(|removed| stamp > removed)
    }

    fn remove(&mut self, stamp: Stamp) {
        let removed = self.removed.map_or(stamp, |removed| removed.max(stamp));
        self.removed = Some(removed);
        clear_up_to(&mut self.kind, removed);
        clear_up_to(&mut self.pose, removed);
        clear_up_to(&mut self.free_space, removed);
        clear_up_to(&mut self.signature, removed);
    }

    /// The node if it is shown. A node with a kind has a pose too: `PutNode` writes both.
    fn shown(&self, id: NodeId) -> Option<NodeRef<'_>> {
        Some(NodeRef {
            id,
            kind: *self.kind.as_ref()?.value(),
            pose: *self.pose.as_ref()?.value(),
            free_space: self.free_space.as_ref().and_then(|register| *register.value()),
            signature: self.signature.as_ref().map(|register| register.value().0.as_ref()),
        })
    }
}

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

/// A map: what a set of increments adds up to. Copies share the descriptors and scans.
#[derive(Clone, Debug, Default)]
pub struct MapState {
    nodes: BTreeMap<NodeId, NodeState>,
    edges: BTreeMap<EdgeKey, Register<bool>>,
    models: BTreeMap<ModelId, Register<DescriptorModel>>,
    max_hlc_us: u64,
    // Follows from `edges`: the nodes that a put edge joins to each node, shown or not.
    adjacent: BTreeMap<NodeId, BTreeSet<NodeId>>,
}

impl MapState {
    /// The empty map.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Joins an increment into the map. Order and repetition do not matter. The increment must have passed validation
    /// (everything from [`fht_proto::decode`] has).
    pub fn apply(&mut self, increment: &Increment) {
        self.max_hlc_us = self.max_hlc_us.max(increment.hlc_us);
        for (stamp, op) in increment.stamped() {
            self.apply_op(stamp, op);
        }
    }

    fn apply_op(&mut self, stamp: Stamp, op: &Op) {
        match op {
            Op::PutNode { id, kind, pose } => self.write(*id, stamp, |node| {
                join_into(&mut node.kind, Register::new(stamp, *kind));
                join_into(&mut node.pose, Register::new(stamp, *pose));
            }),
            Op::RemoveNode { id } => self.nodes.entry(*id).or_default().remove(stamp),
            Op::SetPose { id, pose } => {
                self.write(*id, stamp, |node| join_into(&mut node.pose, Register::new(stamp, *pose)));
            }
            Op::SetFreeSpace { id, rect } => {
                self.write(*id, stamp, |node| join_into(&mut node.free_space, Register::new(stamp, *rect)));
            }
            Op::SetSignature { id, signature } => self.write(*id, stamp, |node| {
                let shared = Shared(Arc::new(signature.clone()));
                join_into(&mut node.signature, Register::new(stamp, shared));
            }),
            Op::PutEdge { edge } => self.write_edge(*edge, Register::new(stamp, true)),
            Op::RemoveEdge { edge } => self.write_edge(*edge, Register::new(stamp, false)),
            Op::PutModel { model } => {
                let register = Register::new(stamp, model.clone());
                match self.models.get_mut(&model.id) {
                    Some(current) => current.join(register),
                    None => _ = self.models.insert(model.id, register),
                }
            }
        }
    }

    fn write(&mut self, id: NodeId, stamp: Stamp, write: impl FnOnce(&mut NodeState)) {
        let node = self.nodes.entry(id).or_default();
        if node.outlives_removal(stamp) {
            write(node);
        }
    }

    fn write_edge(&mut self, edge: EdgeKey, register: Register<bool>) {
        let is_put = match self.edges.get_mut(&edge) {
            Some(current) => {
                current.join(register);
                *current.value()
            }
            None => *self.edges.entry(edge).or_insert(register).value(),
        };
        for (end, other) in [(edge.low(), edge.high()), (edge.high(), edge.low())] {
            let adjacent = self.adjacent.entry(end).or_default();
            if is_put {
                adjacent.insert(other);
            } else {
                adjacent.remove(&other);
            }
        }
    }

    /// BLAKE3 hash of the canonical form: stamps and content hashes of all nodes, edges and models in the order of their
    /// ids, tombstones included. Maps with equal digests are equal now, and stay equal under equal increments.
    #[must_use]
    pub fn digest(&self) -> Digest {
        /// Format of the canonical form, so that a later one cannot be mistaken for this one.
        const FORMAT: &str = "fht-map state 1";
        let hash: ContentHash = content_hash(&(FORMAT, &self.nodes, &self.edges, &self.models));
        Digest(hash)
    }

    /// The newest hybrid logical clock that was applied, microseconds; 0 in the empty map. A writer stamps with more.
    #[must_use]
    pub fn max_hlc_us(&self) -> u64 {
        self.max_hlc_us
    }

    /// The nodes shown, in the order of their ids.
    pub fn nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.nodes.iter().filter_map(|(&id, node)| node.shown(id))
    }

    /// The main nodes shown, in the order of their ids.
    pub fn main_nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.nodes().filter(|node| node.kind == NodeKind::Main)
    }

    /// The node, if it is shown.
    #[must_use]
    pub fn node(&self, id: NodeId) -> Option<NodeRef<'_>> {
        self.nodes.get(&id).and_then(|node| node.shown(id))
    }

    /// The edges shown, in the order of their keys.
    pub fn edges(&self) -> impl Iterator<Item = EdgeKey> + '_ {
        let is_put = self.edges.iter().filter(|(_, register)| *register.value());
        is_put.map(|(&edge, _)| edge).filter(|edge| self.is_shown(edge.low()) && self.is_shown(edge.high()))
    }

    /// The nodes shown that an edge joins to `id`, in the order of their ids; none if `id` is not shown.
    pub fn neighbours(&self, id: NodeId) -> impl Iterator<Item = NodeRef<'_>> {
        let adjacent = self.is_shown(id).then(|| self.adjacent.get(&id)).flatten();
        adjacent.into_iter().flatten().filter_map(|&other| self.node(other))
    }

    /// The descriptor models used, in the order of their ids.
    pub fn models(&self) -> impl Iterator<Item = &DescriptorModel> {
        self.models.values().map(Register::value)
    }

    /// How many nodes and edges are shown.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let mut counts = Counts { edges: self.edges().count(), ..Counts::default() };
        for node in self.nodes() {
            match node.kind {
                NodeKind::Main => counts.main_nodes += 1,
                NodeKind::Support => counts.support_nodes += 1,
            }
        }
        counts
    }

    /// How many nodes, edges and models take up memory, removed ones included.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.nodes.len() + self.edges.len() + self.models.len()
    }

    fn is_shown(&self, id: NodeId) -> bool {
        self.nodes.get(&id).is_some_and(|node| node.kind.is_some())
    }
}
