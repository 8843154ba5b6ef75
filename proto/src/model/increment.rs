//! Increments: the numbered batches of operations that a map consists of.
//!
//! Every operation carries the stamp of its increment, refined by its place in it. For each element
//! the newest stamp wins, so increments can be applied in any order and any number of times
//! (`fht-map` does it).

use crate::model::annotation::{Label, Release, ReleaseId, ReleaseName, Zone};
use crate::model::geometry::{FixedPoint, FixedPose, Rect};
use crate::model::ids::{AuthorId, NodeId};
use crate::model::signature::{DescriptorModel, Signature};
use crate::model::siting::{Datum, PlanImage};
use serde::{Deserialize, Serialize};

/// When an element was last changed: hybrid logical clock, then author, then place in the
/// increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Stamp {
    /// Hybrid logical clock: microseconds, pushed forward so that it never repeats or goes back for
    /// one author and is newer than everything that the author had seen.
    pub hlc_us: u64,
    /// Who wrote.
    pub author: AuthorId,
    /// Which operation of the increment.
    pub op: u16,
}

/// The two kinds of node (paper, section III-B).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NodeKind {
    /// Carries a signature; robots relocalize at it.
    Main,
    /// Carries only its place and its free space; paths lead through it.
    Support,
}

/// An undirected edge, its ends in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct EdgeKey<Id = NodeId> {
    low: Id,
    high: Id,
}

impl<Id: Copy + Ord> EdgeKey<Id> {
    /// The edge between two nodes, in either order.
    #[must_use]
    pub fn new(a: Id, b: Id) -> Self {
        if a <= b { Self { low: a, high: b } } else { Self { low: b, high: a } }
    }

    /// The end that sorts first.
    #[must_use]
    pub fn low(&self) -> Id {
        self.low
    }

    /// The end that sorts last.
    #[must_use]
    pub fn high(&self) -> Id {
        self.high
    }
}

impl<Id: Copy + Ord + std::fmt::Display> EdgeKey<Id> {
    /// Its ends as texts, as replies show them.
    #[must_use]
    pub fn to_texts(&self) -> [String; 2] {
        [self.low.to_string(), self.high.to_string()]
    }
}

/// One change of the map. `Id` is [`NodeId`] everywhere but inside the codec.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Op<Id = NodeId> {
    /// Adds a node, or gives it a new kind and pose.
    PutNode {
        /// Which node.
        id: Id,
        /// Main or support.
        kind: NodeKind,
        /// Where it is.
        pose: FixedPose,
    },
    /// Removes a node, leaving a tombstone. Its edges are no longer shown.
    RemoveNode {
        /// Which node.
        id: Id,
    },
    /// Moves a node, and with it everything that is kept relative to it.
    SetPose {
        /// Which node.
        id: Id,
        /// Where it is now.
        pose: FixedPose,
    },
    /// Sets a node's rectangle of free space, or takes it away.
    SetFreeSpace {
        /// Which node.
        id: Id,
        /// The rectangle.
        rect: Option<Rect>,
    },
    /// Sets a main node's descriptor and scan.
    SetSignature {
        /// Which node.
        id: Id,
        /// What it carries.
        signature: Signature,
    },
    /// Adds an edge that can be driven in a straight line.
    PutEdge {
        /// Its ends. Its length follows from their poses.
        edge: EdgeKey<Id>,
    },
    /// Removes an edge, leaving a tombstone.
    RemoveEdge {
        /// Its ends.
        edge: EdgeKey<Id>,
    },
    /// Describes a descriptor model used by signatures of this map.
    PutModel {
        /// The description.
        model: DescriptorModel,
    },
    /// Says how far a node is still believed, because robots saw what contradicts it, or confirms
    /// it.
    SetTrust {
        /// Which node.
        id: Id,
        /// From 0 to 100; what nobody has doubted has 100.
        percent: u8,
    },
    /// Closes an edge, or opens it again: an operator's word, whatever robots find.
    SetClosed {
        /// Its ends.
        edge: EdgeKey<Id>,
        /// Whether no path may use it.
        closed: bool,
    },
    /// Names a place, moves it, or takes the name away.
    SetPlace {
        /// The name.
        name: Label,
        /// The pose to stop at.
        pose: Option<FixedPose>,
    },
    /// Draws a zone, changes it, or takes it away.
    SetZone {
        /// The name.
        name: Label,
        /// Its rule and border.
        zone: Option<Zone>,
    },
    /// Makes a release. The first one that an author makes under a name stays; later ones under
    /// this name count for nothing.
    PutRelease {
        /// The name.
        name: ReleaseName,
        /// The state named.
        release: Release,
    },
    /// Deletes a release, for ever.
    RemoveRelease {
        /// Which release.
        id: ReleaseId,
    },
    /// Says which release robots are to use; none: the newest state.
    Enable {
        /// Which release.
        release: Option<ReleaseId>,
    },
    /// Says how a floor plan's image lies in the map, or that there is none. Since format 4.
    SetFloorPlan {
        /// The plan.
        plan: Option<PlanImage>,
    },
    /// Says where on earth the map is, or that nobody knows. Since format 4.
    SetDatum {
        /// The place of its origin, and its turn.
        datum: Option<Datum>,
    },
}

impl<A: Copy + Ord> Op<A> {
    /// The same operation with every node id replaced, in the order in which the codec writes and
    /// reads them.
    pub(crate) fn map_ids<B: Copy + Ord>(self, f: &mut impl FnMut(A) -> B) -> Op<B> {
        // The high end first: it is the newer one, and as a rule the node that the operations
        // before are about. The ends stay as they are ordered.
        let mut edge_of = |edge: EdgeKey<A>| {
            let high = f(edge.high);
            EdgeKey { low: f(edge.low), high }
        };
        match self {
            Self::PutNode { id, kind, pose } => Op::PutNode { id: f(id), kind, pose },
            Self::RemoveNode { id } => Op::RemoveNode { id: f(id) },
            Self::SetPose { id, pose } => Op::SetPose { id: f(id), pose },
            Self::SetFreeSpace { id, rect } => Op::SetFreeSpace { id: f(id), rect },
            Self::SetSignature { id, signature } => Op::SetSignature { id: f(id), signature },
            Self::PutEdge { edge } => Op::PutEdge { edge: edge_of(edge) },
            Self::RemoveEdge { edge } => Op::RemoveEdge { edge: edge_of(edge) },
            Self::PutModel { model } => Op::PutModel { model },
            Self::SetTrust { id, percent } => Op::SetTrust { id: f(id), percent },
            Self::SetClosed { edge, closed } => Op::SetClosed { edge: edge_of(edge), closed },
            Self::SetPlace { name, pose } => Op::SetPlace { name, pose },
            Self::SetZone { name, zone } => Op::SetZone { name, zone },
            Self::PutRelease { name, release } => Op::PutRelease { name, release },
            Self::RemoveRelease { id } => Op::RemoveRelease { id },
            Self::Enable { release } => Op::Enable { release },
            Self::SetFloorPlan { plan } => Op::SetFloorPlan { plan },
            Self::SetDatum { datum } => Op::SetDatum { datum },
        }
    }
}

impl Op {
    /// The first format that has this operation, of those that are read.
    #[must_use]
    pub fn format(&self) -> u8 {
        match self {
            Self::SetFloorPlan { .. } | Self::SetDatum { .. } => 4,
            _ => 3,
        }
    }

    /// What it takes up in memory, about, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let beyond = match self {
            Self::SetSignature { signature, .. } => {
                let descriptor = signature.descriptor.as_ref().map_or(0, |descriptor| descriptor.values.len());
                descriptor + size_of::<u16>() * signature.scan.ranges_mm.len()
            }
            Self::PutModel { model } => model.name.len(),
            Self::SetPlace { name, .. } => name.as_str().len(),
            Self::SetZone { name, zone } => {
                let corners = zone.as_ref().map_or(0, |zone| zone.corners.len());
                name.as_str().len() + corners * size_of::<FixedPoint>()
            }
            Self::PutRelease { name, release } => {
                name.as_str().len() + release.vector.iter().count() * 2 * size_of::<(AuthorId, u64)>()
            }
            Self::RemoveRelease { id } => id.name.as_str().len(),
            Self::Enable { release } => release.as_ref().map_or(0, |id| id.name.as_str().len()),
            Self::SetFloorPlan { plan } => plan.as_ref().map_or(0, |plan| plan.image.len()),
            _ => 0,
        };
        size_of::<Self>() + beyond
    }
}

/// A batch of operations by one author. Numbers start at 1 and have no gaps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Increment {
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
    /// The hybrid logical clock of all its operations, microseconds.
    pub hlc_us: u64,
    /// The changes, in order.
    pub ops: Vec<Op>,
}

impl Increment {
    /// Most operations in one increment.
    pub const MAX_OPS: usize = 4096;

    /// What it takes up in memory, about, bytes: some ten times what it takes up on the wire if its
    /// operations are small.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.ops.iter().map(Op::memory_bytes).sum::<usize>()
    }

    /// The operations with their stamps.
    pub fn stamped(&self) -> impl Iterator<Item = (Stamp, &Op)> {
        self.ops.iter().enumerate().map(|(index, op)| {
            let index = u16::try_from(index).unwrap_or(u16::MAX); // MAX_OPS keeps this exact
            (Stamp { hlc_us: self.hlc_us, author: self.author, op: index }, op)
        })
    }
}
