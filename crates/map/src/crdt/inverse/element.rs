//! What is taken back as a whole, and why it may not be.

use fht_proto::{AuthorId, EdgeKey, Label, ModelId, NodeId, Op, ReleaseId};
use std::fmt;

/// Why nothing is taken back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InverseError {
    /// The author has written less than that.
    #[error(
        "{author} has written {written} increment{} of this map, and {count} cannot be taken back",
        if *written == 1 { "" } else { "s" }
    )]
    TooFew {
        /// The author.
        author: AuthorId,
        /// How many there are.
        written: u64,
        /// How many were asked for.
        count: u64,
    },
    /// There are no such increments.
    #[error("{author} has written nothing in this map that is to be taken back")]
    NoneSuch {
        /// The author.
        author: AuthorId,
    },
    /// What was before is not known any more.
    #[error(
        "the increments of {author} up to {last} are folded{}: what was before them is not known any more. A release \
         from before is what it was, and so is a backup; places, zones and closures can be taken away one by one",
        match later { 0 => String::new(), later => format!(", and only the last {later} can be taken back") }
    )]
    Compacted {
        /// The author.
        author: AuthorId,
        /// Number of the last one.
        last: u64,
        /// So many were written after it.
        later: u64,
    },
    /// Somebody else has written there since.
    #[error("{what} was changed by {by} since: nothing is taken back")]
    Overwritten {
        /// What.
        what: String,
        /// Who.
        by: AuthorId,
    },
    /// Robots use the release that would be deleted.
    #[error("release {release} is what robots use: enable another one, or head, before its making is taken back")]
    InUse {
        /// The release.
        release: ReleaseId,
    },
    /// The release that robots used before has been deleted.
    #[error("release {release}, which robots used before, has been deleted since: nothing is taken back")]
    Deleted {
        /// The release.
        release: ReleaseId,
    },
    /// The increments have changed nothing.
    #[error(
        "there is nothing to take back: of what increments {first} to {last} of {author} have changed, nothing is left, \
         or others have written it since"
    )]
    Unchanged {
        /// The author.
        author: AuthorId,
        /// Number of the first.
        first: u64,
        /// Number of the last.
        last: u64,
    },
}

impl InverseError {
    /// The same for people, with names of robots or operators in place of their author ids.
    #[must_use]
    pub fn with_names<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> String {
        match self {
            // A release is named by its id, of which its author's is a part.
            Self::InUse { .. } | Self::Deleted { .. } => self.to_string(),
            _ => names
                .into_iter()
                .fold(self.to_string(), |text, name| text.replace(&AuthorId::of_robot(name).to_string(), name)),
        }
    }
}

/// Something that is taken back as a whole.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Element {
    Node(NodeId),
    Edge(EdgeKey),
    Closure(EdgeKey),
    Model(ModelId),
    Place(Label),
    Zone(Label),
    // What robots use may be a release that is put back: releases come first.
    Release(ReleaseId),
    Enabled,
    FloorPlan,
    Datum,
}

impl Element {
    pub(super) fn of(author: AuthorId, op: &Op) -> Self {
        match op {
            Op::PutNode { id, .. }
            | Op::RemoveNode { id }
            | Op::SetPose { id, .. }
            | Op::SetFreeSpace { id, .. }
            | Op::SetSignature { id, .. }
            | Op::SetTrust { id, .. } => Self::Node(*id),
            Op::PutEdge { edge } | Op::RemoveEdge { edge } => Self::Edge(*edge),
            Op::SetClosed { edge, .. } => Self::Closure(*edge),
            Op::PutModel { model } => Self::Model(model.id),
            Op::SetPlace { name, .. } => Self::Place(name.clone()),
            Op::SetZone { name, .. } => Self::Zone(name.clone()),
            Op::PutRelease { name, .. } => Self::Release(ReleaseId { author, name: name.clone() }),
            Op::RemoveRelease { id } => Self::Release(id.clone()),
            Op::Enable { .. } => Self::Enabled,
            Op::SetFloorPlan { .. } => Self::FloorPlan,
            Op::SetDatum { .. } => Self::Datum,
        }
    }

    /// Whether one write says all of it, so that the same write again brings the same about.
    pub(super) fn is_one_value(&self) -> bool {
        match self {
            Self::Edge(_) | Self::Closure(_) | Self::Place(_) | Self::Zone(_) | Self::FloorPlan | Self::Datum => true,
            Self::Node(_) | Self::Model(_) | Self::Release(_) | Self::Enabled => false,
        }
    }
}

impl fmt::Display for Element {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Node(id) => write!(f, "node {id}"),
            Self::Edge(edge) => write!(f, "the edge {} {}", edge.low(), edge.high()),
            Self::Closure(edge) => write!(f, "whether the edge {} {} is closed", edge.low(), edge.high()),
            Self::Model(_) => f.write_str("the descriptor model"),
            Self::Place(name) => write!(f, "place {name}"),
            Self::Zone(name) => write!(f, "zone {name}"),
            Self::Release(id) => write!(f, "release {id}"),
            Self::Enabled => f.write_str("the release that robots use"),
            Self::FloorPlan => f.write_str("how the floor plan lies"),
            Self::Datum => f.write_str("where on earth the map is"),
        }
    }
}
