//! What a mapper knows of a map that others write, too.

use crate::explore::Team;
use crate::team::Joining;
use fht_descriptor::DescriptorNet;
use fht_map::{MapState, NodeRef, Rules};
use fht_perception::pose::Pose2;
use fht_proto::{AuthorId, FixedPose, NodeId, NodeKind, Rect};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A robot that is to join a map and does not know yet where in it it is.
pub(super) struct Newcomer {
    pub(super) joining: Joining,
    pub(super) eyes: Option<DescriptorNet>,
    /// The map, and how many increments of this author the server has.
    pub(super) shared: Option<(MapState, u64)>,
    pub(super) remembered: Option<Pose2>,
}

/// What of a node is news when it changes.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Known {
    pub(super) kind: NodeKind,
    pub(super) pose: FixedPose,
    pub(super) free_space: Option<Rect>,
    pub(super) has_signature: bool,
}

impl Known {
    pub(super) fn of(node: &NodeRef<'_>) -> Self {
        let has_signature = node.signature.is_some();
        Self { kind: node.kind, pose: node.pose, free_space: node.free_space, has_signature }
    }
}

/// What others have made of the map.
#[derive(Default)]
pub(super) struct Others {
    pub(super) nodes: BTreeMap<NodeId, Known>,
    /// Who had written before this robot joined: it holds itself to their nodes.
    pub(super) seniors: BTreeSet<AuthorId>,
    pub(super) team: Team,
    /// What operators and other robots have closed.
    pub(super) rules: Arc<Rules>,
}
