//! Finds the operations that a server can drop.
//!
//! In a map that has been used for months, most operations are poses that were corrected again and
//! rectangles that grew. A server keeps only a few states for good: its releases, and everything
//! from some vector on. An operation can go if another one overrules it in each of those states.
//!
//! The kept states stay exactly the same, digests included, whatever comes later: later states
//! contain the last kept one, and what is overruled there stays overruled.

use crate::crdt::register::content_hash;
use fht_proto::model::compaction::{CompactedSeries, Rest};
use fht_proto::{AuthorId, EdgeKey, Increment, Label, ModelId, NodeId, Op, ReleaseId, Stamp, VersionVector};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Something that one operation decides in the end.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Decision {
    Removal(NodeId),
    Kind(NodeId),
    Pose(NodeId),
    FreeSpace(NodeId),
    Signature(NodeId),
    Trust(NodeId),
    Edge(EdgeKey),
    Closure(EdgeKey),
    Model(ModelId),
    Place(Label),
    Zone(Label),
    Release(ReleaseId),
    Deletion(ReleaseId),
    Enabled,
    FloorPlan,
    Datum,
}

impl Decision {
    /// The node that this is about, if a removal of the node makes it void.
    fn node(&self) -> Option<NodeId> {
        match self {
            Self::Kind(id) | Self::Pose(id) | Self::FreeSpace(id) | Self::Signature(id) | Self::Trust(id) => Some(*id),
            _ => None,
        }
    }

    /// What an operation of `author` has a say in.
    fn of(op: &Op, author: AuthorId) -> Vec<Self> {
        match op {
            Op::PutNode { id, .. } => vec![Self::Kind(*id), Self::Pose(*id)],
            Op::RemoveNode { id } => vec![Self::Removal(*id)],
            Op::SetPose { id, .. } => vec![Self::Pose(*id)],
            Op::SetFreeSpace { id, .. } => vec![Self::FreeSpace(*id)],
            Op::SetSignature { id, .. } => vec![Self::Signature(*id)],
            Op::SetTrust { id, .. } => vec![Self::Trust(*id)],
            Op::PutEdge { edge } | Op::RemoveEdge { edge } => vec![Self::Edge(*edge)],
            Op::SetClosed { edge, .. } => vec![Self::Closure(*edge)],
            Op::PutModel { model } => vec![Self::Model(model.id)],
            Op::SetPlace { name, .. } => vec![Self::Place(name.clone())],
            Op::SetZone { name, .. } => vec![Self::Zone(name.clone())],
            Op::PutRelease { name, .. } => vec![Self::Release(ReleaseId { author, name: name.clone() })],
            Op::RemoveRelease { id } => vec![Self::Deletion(id.clone())],
            Op::Enable { .. } => vec![Self::Enabled],
            Op::SetFloorPlan { .. } => vec![Self::FloorPlan],
            Op::SetDatum { .. } => vec![Self::Datum],
        }
    }
}

/// One operation of an author: increment and place there.
type OpAt = (AuthorId, u64, u16);

/// Who decides.
#[derive(Clone, Copy, Debug)]
struct Winner<'a> {
    stamp: Stamp,
    at: OpAt,
    op: &'a Op,
}

impl Winner<'_> {
    /// Whether this overrules `other` in `decision`. Of releases under one name the first counts;
    /// else the newest, and of equal stamps, which only a broken author writes, both are kept.
    fn overrules(&self, other: &Self, decision: &Decision) -> bool {
        match decision {
            Decision::Release(_) => (self.at.1, self.stamp) < (other.at.1, other.stamp),
            _ => self.stamp > other.stamp,
        }
    }
}

/// The operations that decide anything in the state that consists of `increments` up to `vector`.
fn deciding(increments: &[CompactedSeries], vector: &VersionVector) -> BTreeSet<OpAt> {
    let mut winners: BTreeMap<Decision, Vec<Winner<'_>>> = BTreeMap::new();
    for compact in increments {
        let upto = vector.get(compact.author);
        for (stamp, number, op) in compact.stamped().filter(|(_, number, _)| *number <= upto) {
            let candidate = Winner { stamp, at: (compact.author, number, stamp.op), op };
            for decision in Decision::of(op, compact.author) {
                let standing = winners.entry(decision.clone()).or_default();
                if standing.iter().any(|winner| winner.overrules(&candidate, &decision)) {
                    continue;
                }
                standing.retain(|winner| !candidate.overrules(winner, &decision));
                // A repetition of the same content under the same stamp adds nothing.
                if !standing.iter().any(|w| w.stamp == stamp && content_hash(w.op) == content_hash(op)) {
                    standing.push(candidate);
                }
            }
        }
    }
    let removed_at = |id: NodeId| winners.get(&Decision::Removal(id)).and_then(|w| w.iter().map(|w| w.stamp).max());
    let counts = |decision: &Decision, winner: &Winner<'_>| {
        decision.node().and_then(removed_at).is_none_or(|removed| winner.stamp > removed)
    };
    let of_decision = |(decision, standing): (&Decision, &Vec<Winner<'_>>)| {
        standing.iter().filter(|winner| counts(decision, winner)).map(|winner| winner.at).collect::<Vec<_>>()
    };
    winners.iter().flat_map(of_decision).collect()
}

/// An increment as a fold of itself.
#[must_use]
pub fn whole(increment: &Increment) -> CompactedSeries {
    let ops = increment.stamped().map(|(stamp, op)| (stamp.op, op.clone())).collect();
    let rest = Rest { number: increment.number, hlc_us: increment.hlc_us, ops };
    CompactedSeries { author: increment.author, first: increment.number, last: increment.number, rests: vec![rest] }
}

/// How a folded log is cut into messages.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CompactionConfig {
    /// About how long a message may become, bytes as they are in memory. Default 64 KiB.
    pub max_bytes: usize,
}

impl Default for CompactionConfig {
    fn default() -> Self {
        Self { max_bytes: 64 << 10 }
    }
}

/// What is left of a log: `log` holds the increments (and folds from before) of all authors up to
/// `upto`, each author's in order and without gaps. The states at `upto` and at all of `kept`, and
/// every later state, stay what they are; no fold reaches across one of them, so that each is the
/// sum of whole folds and of increments beyond `upto`.
#[must_use]
pub fn compact(
    log: &[CompactedSeries],
    upto: &VersionVector,
    kept: &[VersionVector],
    config: &CompactionConfig,
) -> Vec<CompactedSeries> {
    // Of a kept state that reaches beyond, the part up to here: what decides in the whole decides
    // in the part.
    let states: Vec<VersionVector> = kept.iter().map(|vector| vector.meet(upto)).chain([upto.clone()]).collect();
    let needed: BTreeSet<OpAt> = states.iter().flat_map(|state| deciding(log, state)).collect();
    let mut folded: Vec<CompactedSeries> = Vec::new();
    let mut by_author: BTreeMap<AuthorId, Vec<&CompactedSeries>> = BTreeMap::new();
    for compact in log {
        by_author.entry(compact.author).or_default().push(compact);
    }
    for (author, pieces) in by_author {
        let cuts: BTreeSet<u64> = states.iter().map(|state| state.get(author)).collect();
        let mut open: Option<(CompactedSeries, usize)> = None;
        for piece in pieces.into_iter().filter(|piece| piece.last <= upto.get(author)) {
            let keep = |rest: &Rest| {
                let is_needed = |index: u16| needed.contains(&(author, rest.number, index));
                let ops: Vec<(u16, Op)> = rest.ops.iter().filter(|(index, _)| is_needed(*index)).cloned().collect();
                (!ops.is_empty()).then_some(Rest { number: rest.number, hlc_us: rest.hlc_us, ops })
            };
            let rests: Vec<Rest> = piece.rests.iter().filter_map(keep).collect();
            let shrunk = CompactedSeries { author, first: piece.first, last: piece.last, rests };
            let bytes = shrunk.memory_bytes();
            match &mut open {
                Some((compact, total)) if *total + bytes <= config.max_bytes => {
                    compact.last = shrunk.last;
                    compact.rests.extend(shrunk.rests);
                    *total += bytes;
                }
                _ => folded.extend(open.replace((shrunk, bytes)).map(|(compact, _)| compact)),
            }
            if cuts.contains(&piece.last) {
                folded.extend(open.take().map(|(compact, _)| compact));
            }
        }
        folded.extend(open.map(|(compact, _)| compact));
    }
    folded
}
