//! The nodes of one author with neighbouring numbers, and the edges that begin there: the unit in
//! which a map is shared between its copies and hashed. A change copies and hashes one leaf, not
//! the map.

use crate::crdt::register::{ContentHash, Register, content_hash, join_into};
use fht_proto::{AuthorId, EdgeKey, FixedPose, NodeId, NodeKind, Rect, Signature, Stamp};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

/// Numbers of one author in one leaf. The work for a change of a map grows with this, and that for
/// its digest with the number of leaves.
const NUMBERS_PER_LEAF: u32 = 128;

/// Which leaf: author and number over [`NUMBERS_PER_LEAF`]. Leaves come in the order of their
/// nodes.
pub(crate) type LeafKey = (AuthorId, u32);

/// The leaf of a node.
pub(crate) fn leaf_of(id: NodeId) -> LeafKey {
    (id.author, id.number / NUMBERS_PER_LEAF)
}

/// A signature, hashed once, and shared by all copies of the map.
#[derive(Clone, Debug)]
pub(crate) struct Shared(Arc<(Signature, ContentHash)>);

impl Shared {
    pub(crate) fn new(signature: Signature) -> Self {
        let hash = content_hash(&signature);
        Self(Arc::new((signature, hash)))
    }

    pub(crate) fn signature(&self) -> &Signature {
        &self.0.0
    }
}

impl Serialize for Shared {
    // The hash stands for it: a digest need not read all descriptors and scans again.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.1.serialize(serializer)
    }
}

/// What is known of one node, shown or not.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct NodeState {
    removed: Option<Stamp>,
    pub(crate) kind: Option<Register<NodeKind>>,
    pub(crate) pose: Option<Register<FixedPose>>,
    pub(crate) free_space: Option<Register<Option<Rect>>>,
    pub(crate) signature: Option<Register<Shared>>,
    pub(crate) trust: Option<Box<Register<u8>>>,
}

fn clear_up_to<T: Serialize>(slot: &mut Option<Register<T>>, removed: Stamp) {
    if slot.as_ref().is_some_and(|register| register.stamp() <= removed) {
        *slot = None;
    }
}

impl NodeState {
    /// Whether what is written at `stamp` counts.
    pub(crate) fn outlives_removal(&self, stamp: Stamp) -> bool {
        self.removed.is_none_or(|removed| stamp > removed)
    }

    /// When it was taken away last.
    pub(crate) fn removed(&self) -> Option<Stamp> {
        self.removed
    }

    pub(crate) fn remove(&mut self, stamp: Stamp) {
        let removed = self.removed.map_or(stamp, |removed| removed.max(stamp));
        self.removed = Some(removed);
        clear_up_to(&mut self.kind, removed);
        clear_up_to(&mut self.pose, removed);
        clear_up_to(&mut self.free_space, removed);
        clear_up_to(&mut self.signature, removed);
        if self.trust.as_ref().is_some_and(|register| register.stamp() <= removed) {
            self.trust = None;
        }
    }

    pub(crate) fn set_trust(&mut self, register: Register<u8>) {
        match &mut self.trust {
            Some(current) => current.join(register),
            None => self.trust = Some(Box::new(register)),
        }
    }

    /// Who it is there for: who put it, else who removed it, else who wrote anything to it.
    pub(crate) fn writer(&self) -> Option<AuthorId> {
        let stamps = [
            self.kind.as_ref().map(Register::stamp),
            self.removed,
            self.trust.as_ref().map(|register| register.stamp()),
            self.free_space.as_ref().map(Register::stamp),
            self.pose.as_ref().map(Register::stamp),
            self.signature.as_ref().map(Register::stamp),
        ];
        stamps.into_iter().flatten().next().map(|stamp| stamp.author)
    }

    /// Its kind if it is shown.
    pub(crate) fn shown_kind(&self) -> Option<NodeKind> {
        self.kind.as_ref().map(|kind| *kind.value())
    }
}

/// What is known of one edge.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct EdgeState {
    put: Option<Register<bool>>,
    // Few are ever closed.
    closed: Option<Box<Register<bool>>>,
}

impl EdgeState {
    /// Who it is there for.
    pub(crate) fn writer(&self) -> Option<AuthorId> {
        let closed = self.closed.as_ref().map(|register| register.stamp());
        self.put.as_ref().map(Register::stamp).or(closed).map(|stamp| stamp.author)
    }

    pub(crate) fn is_put(&self) -> bool {
        self.put.as_ref().is_some_and(|register| *register.value())
    }

    pub(crate) fn is_closed(&self) -> bool {
        self.closed.as_ref().is_some_and(|register| *register.value())
    }

    pub(crate) fn put(&mut self, register: Register<bool>) {
        join_into(&mut self.put, register);
    }

    pub(crate) fn close(&mut self, register: Register<bool>) {
        match &mut self.closed {
            Some(current) => current.join(register),
            None => self.closed = Some(Box::new(register)),
        }
    }
}

/// Some neighbouring numbers of one author.
#[derive(Clone, Debug, Default)]
pub(crate) struct Leaf {
    /// By number.
    nodes: Vec<(u32, NodeState)>,
    /// The edges whose lower end is one of these nodes, by that end's number and the other end.
    edges: BTreeMap<(u32, NodeId), EdgeState>,
    /// Follows from the edges: the nodes that a put edge joins to each of these, shown or not.
    adjacent: BTreeSet<(u32, NodeId)>,
    digest: OnceLock<ContentHash>,
}

const LEAST_ID: NodeId = NodeId { author: AuthorId(0), number: 0 };
const GREATEST_ID: NodeId = NodeId { author: AuthorId(u32::MAX), number: u32::MAX };

impl Leaf {
    pub(crate) fn node(&self, number: u32) -> Option<&NodeState> {
        let index = self.nodes.binary_search_by_key(&number, |(number, _)| *number).ok()?;
        self.nodes.get(index).map(|(_, node)| node)
    }

    /// All nodes, shown or not, by number.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = (u32, &NodeState)> {
        self.nodes.iter().map(|(number, node)| (*number, node))
    }

    /// The node of this number, new if there was none, to be written; and whether it is new.
    pub(crate) fn node_mut(&mut self, number: u32) -> (&mut NodeState, bool) {
        self.digest = OnceLock::new();
        let found = self.nodes.binary_search_by_key(&number, |(number, _)| *number);
        let index = found.unwrap_or_else(|index| {
            self.nodes.insert(index, (number, NodeState::default()));
            index
        });
        (&mut self.nodes[index].1, found.is_err())
    }

    /// All edges, put or not, by key.
    pub(crate) fn edges(&self) -> impl Iterator<Item = (u32, NodeId, &EdgeState)> {
        self.edges.iter().map(|(&(low, high), edge)| (low, high, edge))
    }

    pub(crate) fn edge(&self, edge: EdgeKey) -> Option<&EdgeState> {
        self.edges.get(&(edge.low().number, edge.high()))
    }

    /// The edge, which begins here, new if there was none, to be written; and whether it is new.
    pub(crate) fn edge_mut(&mut self, edge: EdgeKey) -> (&mut EdgeState, bool) {
        self.digest = OnceLock::new();
        let key = (edge.low().number, edge.high());
        let is_new = !self.edges.contains_key(&key);
        (self.edges.entry(key).or_default(), is_new)
    }

    pub(crate) fn set_adjacent(&mut self, number: u32, other: NodeId, is_put: bool) {
        if is_put {
            self.adjacent.insert((number, other));
        } else {
            self.adjacent.remove(&(number, other));
        }
    }

    /// The nodes that a put edge joins to one, in the order of their ids.
    pub(crate) fn adjacent(&self, number: u32) -> impl Iterator<Item = NodeId> + '_ {
        self.adjacent.range((number, LEAST_ID)..=(number, GREATEST_ID)).map(|&(_, other)| other)
    }

    /// Whether nothing was written here: it only knows of edges that begin elsewhere.
    pub(crate) fn is_empty(&self) -> bool {
        self.nodes.is_empty() && self.edges.is_empty()
    }

    /// Hash of all that was written here.
    pub(crate) fn digest(&self) -> ContentHash {
        *self.digest.get_or_init(|| content_hash(&(&self.nodes, &self.edges)))
    }
}
