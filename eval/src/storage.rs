//! What a map's bytes are spent on.

use fht_proto::{CodecError, Increment, NodeId, NodeKind, Op, decode, encode};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Bytes of all increments as they travel, history included, by content.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Storage {
    /// All of it.
    pub total: usize,
    /// Main nodes: ids and poses.
    pub main_nodes: usize,
    /// Main nodes' descriptors.
    pub descriptors: usize,
    /// Main nodes' scans.
    pub scans: usize,
    /// Rectangles of main nodes, each time they were set.
    pub main_rectangles: usize,
    /// Support nodes: ids and poses.
    pub support_nodes: usize,
    /// Rectangles of support nodes, each time they were set.
    pub support_rectangles: usize,
    /// Edges.
    pub edges: usize,
    /// Poses corrected after a node was made, and removals.
    pub corrections: usize,
    /// Descriptions of descriptor models.
    pub models: usize,
    /// Overhead of increments: envelope, author, number, clock.
    pub envelopes: usize,
    /// Increments.
    pub increments: usize,
}

impl Storage {
    /// The split of the bytes of `increments`, which are in the order of their numbers.
    ///
    /// # Errors
    /// [`CodecError`] of an increment that cannot be read.
    pub fn of(increments: &[Vec<u8>]) -> Result<Self, CodecError> {
        let mut storage = Self { increments: increments.len(), ..Self::default() };
        let mut kinds: BTreeMap<NodeId, NodeKind> = BTreeMap::new();
        for bytes in increments {
            let increment: Increment = decode(bytes)?;
            storage.total += bytes.len();
            // The length with its first operations only. The first one's share shows when it is
            // there twice; named again, its node costs a byte or two less.
            let length = |ops: Vec<Op>| encode(&Increment { ops, ..increment }).map(|bytes| bytes.len());
            let mut before = None;
            for (at, op) in increment.ops.iter().enumerate() {
                let now = length(increment.ops[..=at].to_vec())?;
                let more = match before {
                    Some(before) => now - before,
                    None => length(vec![op.clone(), op.clone()])? - now,
                };
                storage.count(op, more, &mut kinds);
                before = Some(now);
            }
        }
        let named = storage.main_nodes
            + storage.descriptors
            + storage.scans
            + storage.main_rectangles
            + storage.support_nodes
            + storage.support_rectangles
            + storage.edges
            + storage.corrections
            + storage.models;
        storage.envelopes = storage.total - named;
        Ok(storage)
    }

    fn count(&mut self, op: &Op, more: usize, kinds: &mut BTreeMap<NodeId, NodeKind>) {
        match op {
            Op::PutNode { id, kind, .. } => {
                kinds.insert(*id, *kind);
                *(if *kind == NodeKind::Main { &mut self.main_nodes } else { &mut self.support_nodes }) += more;
            }
            Op::SetFreeSpace { id, .. } => {
                let is_main = kinds.get(id) == Some(&NodeKind::Main);
                *(if is_main { &mut self.main_rectangles } else { &mut self.support_rectangles }) += more;
            }
            Op::SetSignature { signature, .. } => {
                let descriptor = signature.descriptor.as_ref().and_then(|it| postcard::to_stdvec(it).ok());
                let descriptor = descriptor.map_or(0, |bytes| bytes.len());
                self.descriptors += descriptor;
                self.scans += more.saturating_sub(descriptor);
            }
            Op::PutEdge { .. } => self.edges += more,
            Op::SetPose { .. } | Op::RemoveNode { .. } | Op::RemoveEdge { .. } | Op::SetTrust { .. } => {
                self.corrections += more;
            }
            Op::PutModel { .. } => self.models += more,
            // Operators write nothing during an exploration.
            Op::SetClosed { .. }
            | Op::SetPlace { .. }
            | Op::SetZone { .. }
            | Op::PutRelease { .. }
            | Op::RemoveRelease { .. }
            | Op::Enable { .. }
            | Op::SetFloorPlan { .. }
            | Op::SetDatum { .. } => {}
        }
    }
}
