//! What is left of old increments. Of operations that later ones overrule, nobody needs the
//! earlier; a server that keeps maps for long folds the increments up to some vector, so that the
//! states which it promised to keep stay exactly what they are.
//!
//! Each operation keeps its author, its increment's number and clock, and its place there: its
//! stamp. So a fold joins a map like the increments that it stands for, in any order with others
//! and any number of times.

use crate::model::ids::{AuthorId, NodeId};
use crate::model::increment::{Increment, Op, Stamp};
use serde::{Deserialize, Serialize};

/// What is left of one increment: some of its operations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rest<Id = NodeId> {
    /// The increment's number.
    pub number: u64,
    /// The increment's clock, microseconds.
    pub hlc_us: u64,
    /// Operations with their places in the increment, ascending.
    pub ops: Vec<(u16, Op<Id>)>,
}

impl<A: Copy + Ord> Rest<A> {
    pub(crate) fn map_ids<B: Copy + Ord>(self, f: &mut impl FnMut(A) -> B) -> Rest<B> {
        let ops = self.ops.into_iter().map(|(index, op)| (index, op.map_ids(f))).collect();
        Rest { number: self.number, hlc_us: self.hlc_us, ops }
    }
}

/// What is left of an author's increments `first` to `last`.
#[derive(Clone, Debug, PartialEq)]
pub struct CompactedSeries {
    /// Who wrote them.
    pub author: AuthorId,
    /// Number of the first increment that it stands for, from 1.
    pub first: u64,
    /// Number of the last one.
    pub last: u64,
    /// What is left, by number. Of most increments nothing is left.
    pub rests: Vec<Rest>,
}

impl CompactedSeries {
    /// The operations, each with its stamp and its increment's number.
    pub fn stamped(&self) -> impl Iterator<Item = (Stamp, u64, &Op)> {
        self.rests.iter().flat_map(move |rest| {
            let stamp = move |op: u16| Stamp { hlc_us: rest.hlc_us, author: self.author, op };
            rest.ops.iter().map(move |(index, op)| (stamp(*index), rest.number, op))
        })
    }

    /// What it takes up in memory, about, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let of_rest = |rest: &Rest| size_of::<Rest>() + rest.ops.iter().map(|(_, op)| op.memory_bytes()).sum::<usize>();
        size_of::<Self>() + self.rests.iter().map(of_rest).sum::<usize>()
    }
}

/// A part of a map: what travels in one message of limited size, or stands in a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// What is left of increments that were compacted. Each comes before all other increments of
    /// its author.
    pub folds: Vec<CompactedSeries>,
    /// The increments, in an order in which each author's numbers ascend.
    pub increments: Vec<Increment>,
}
