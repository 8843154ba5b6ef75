//! The state of a map: the join of all increments applied to it.
//!
//! Every element is a set of last-writer-wins registers. A node is shown while its newest `PutNode` is newer than its
//! newest `RemoveNode`; writes older than a node's newest removal are void, whether they come before or after it. So
//! the state depends on which increments were applied and on nothing else.

use crate::register::Register;
use fht_proto::{
    Descriptor, DescriptorModel, Digest, EdgeKey, FixedPose, Increment, ModelId, NodeId, NodeKind, Op, Rect, Signature,
    Stamp,
};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
struct NodeEntry {
    removed: Option<Stamp>,
    kind: Option<Register<NodeKind>>,
    pose: Option<Register<FixedPose>>,
    free_space: Option<Register<Option<Rect>>>,
    signature: Option<Register<Signature>>,
}

impl NodeEntry {
    /// Whether a write with this stamp still counts.
    fn accepts(&self, stamp: Stamp) -> bool {
        self.removed.is_none_or(|removed| stamp > removed)
    }

    fn remove(&mut self, stamp: Stamp) {
        self.removed = self.removed.max(Some(stamp));
        fn void<T: Serialize>(slot: &mut Option<Register<T>>, stamp: Stamp) {
            if slot.as_ref().is_some_and(|register| register.stamp() <= stamp) {
                *slot = None;
            }
        }
        void(&mut self.kind, stamp);
        void(&mut self.pose, stamp);
        void(&mut self.free_space, stamp);
        void(&mut self.signature, stamp);
    }

    /// The node as shown, if it is.
    fn view(&self, id: NodeId) -> Option<NodeRef<'_>> {
        Some(NodeRef {
            id,
            kind: *self.kind.as_ref()?.value(),
            pose: *self.pose.as_ref()?.value(),
            free_space: self.free_space.as_ref().and_then(|register| *register.value()),
            signature: self.signature.as_ref().map(Register::value),
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
    /// Where it is, in the map frame.
    pub pose: FixedPose,
    /// Its rectangle of free space.
    pub free_space: Option<Rect>,
    /// What a main node carries.
    pub signature: Option<&'a Signature>,
}

impl<'a> NodeRef<'a> {
    /// The descriptor of a main node with a camera.
    #[must_use]
    pub fn descriptor(&self) -> Option<&'a Descriptor> {
        self.signature.and_then(|signature| signature.descriptor.as_ref())
    }
}

/// How many elements are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Main nodes.
    pub main_nodes: usize,
    /// Support nodes.
    pub support_nodes: usize,
    /// Edges with both ends shown.
    pub edges: usize,
}

/// A map.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MapState {
    nodes: BTreeMap<NodeId, NodeEntry>,
    edges: BTreeMap<EdgeKey, Option<Register<bool>>>,
    models: BTreeMap<ModelId, Option<Register<DescriptorModel>>>,
    /// Derived from `edges`: the neighbours of a node by edges that are put, whether or not both ends are shown.
    #[serde(skip)]
    adjacency: BTreeMap<NodeId, BTreeSet<NodeId>>,
    #[serde(skip)]
    max_hlc_us: u64,
}

impl MapState {
    /// The empty map.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Joins an increment. Any order, any number of times: the result is the same.
    pub fn apply(&mut self, increment: &Increment) {
        self.max_hlc_us = self.max_hlc_us.max(increment.hlc_us);
        for (stamp, op) in increment.stamped() {
            self.apply_op(stamp, op);
        }
    }

    fn apply_op(&mut self, stamp: Stamp, op: &Op) {
        match op {
            Op::PutNode { id, kind, pose } => self.write_node(*id, stamp, |entry| {
                Register::join(&mut entry.kind, stamp, *kind);
                Register::join(&mut entry.pose, stamp, *pose);
            }),
            Op::RemoveNode { id } => self.nodes.entry(*id).or_default().remove(stamp),
            Op::SetPose { id, pose } => {
                self.write_node(*id, stamp, |entry| Register::join(&mut entry.pose, stamp, *pose));
            }
            Op::SetFreeSpace { id, rect } => {
                self.write_node(*id, stamp, |entry| Register::join(&mut entry.free_space, stamp, *rect));
            }
            Op::SetSignature { id, signature } => {
                self.write_node(*id, stamp, |entry| Register::join(&mut entry.signature, stamp, signature.clone()));
            }
            Op::PutEdge { edge } => self.write_edge(*edge, stamp, true),
            Op::RemoveEdge { edge } => self.write_edge(*edge, stamp, false),
            Op::PutModel { model } => {
                Register::join(self.models.entry(model.id).or_default(), stamp, model.clone());
            }
        }
    }

    fn write_node(&mut self, id: NodeId, stamp: Stamp, write: impl FnOnce(&mut NodeEntry)) {
        let entry = self.nodes.entry(id).or_default();
        if entry.accepts(stamp) {
            write(entry);
        }
    }

    fn write_edge(&mut self, edge: EdgeKey, stamp: Stamp, is_put: bool) {
        let slot = self.edges.entry(edge).or_default();
        Register::join(slot, stamp, is_put);
        let is_put = slot.as_ref().is_some_and(|register| *register.value());
        for (from, to) in [(edge.low(), edge.high()), (edge.high(), edge.low())] {
            let neighbours = self.adjacency.entry(from).or_default();
            if is_put {
                neighbours.insert(to);
            } else {
                neighbours.remove(&to);
            }
        }
    }

    /// BLAKE3 hash of the canonical form: all registers and tombstones with their stamps, in the order of their keys.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let canonical = postcard::to_stdvec(self).unwrap_or_default();
        Digest(*blake3::hash(&canonical).as_bytes())
    }

    /// The newest clock of all increments applied, microseconds.
    #[must_use]
    pub fn max_hlc_us(&self) -> u64 {
        self.max_hlc_us
    }

    /// The nodes shown, in the order of their ids.
    pub fn nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.nodes.iter().filter_map(|(id, entry)| entry.view(*id))
    }

    /// The main nodes shown, in the order of their ids.
    pub fn main_nodes(&self) -> impl Iterator<Item = NodeRef<'_>> {
        self.nodes().filter(|node| node.kind == NodeKind::Main)
    }

    /// A node, if it is shown.
    #[must_use]
    pub fn node(&self, id: NodeId) -> Option<NodeRef<'_>> {
        self.nodes.get(&id)?.view(id)
    }

    /// The edges with both ends shown, in the order of their keys.
    pub fn edges(&self) -> impl Iterator<Item = EdgeKey> + '_ {
        let is_put = |slot: &Option<Register<bool>>| slot.as_ref().is_some_and(|register| *register.value());
        self.edges
            .iter()
            .filter(move |(edge, slot)| {
                is_put(slot) && self.node(edge.low()).is_some() && self.node(edge.high()).is_some()
            })
            .map(|(edge, _)| *edge)
    }

    /// The nodes shown that a node shown has edges to, in the order of their ids.
    pub fn neighbours(&self, id: NodeId) -> impl Iterator<Item = NodeRef<'_>> {
        let shown = self.node(id).is_some();
        let neighbours = self.adjacency.get(&id).filter(|_| shown).into_iter().flatten();
        neighbours.filter_map(|neighbour| self.node(*neighbour))
    }

    /// The descriptor models of the map's signatures.
    pub fn models(&self) -> impl Iterator<Item = &DescriptorModel> {
        self.models.values().filter_map(|slot| slot.as_ref().map(Register::value))
    }

    /// How many elements are shown.
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
}
