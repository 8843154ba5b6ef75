//! What a search through the mesh writes down.

use crate::navmesh::mesh::Mesh;
use crate::navmesh::plane::Corner;
use crate::navmesh::polyanya::interval::View;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A workspace with room for more than this is not kept for the next search.
const KEPT_REACHES: usize = 1 << 14;

/// What a search knows of one way into one triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// What can be seen from the root. The rays meet the side that was crossed.
    pub(super) seen: View,
    /// The triangle behind the side; [`NONE`] once the goal is reached.
    pub(super) triangle: u32,
    /// The corner that was turned around last, by its number among the turns.
    pub(super) root: u32,
    /// The side of the triangle.
    pub(super) side: u8,
}

/// A corner that a way turns around.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turn {
    pub(super) place: Corner,
    /// Length of the way to it, millimetres.
    pub(super) length: f64,
    /// The corner's number; [`NONE`] for the start.
    pub(super) corner: u32,
    /// The turn before it, or [`NONE`].
    pub(super) before: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Waiting {
    /// Least length of a way to the goal; its length, if the goal is reached.
    pub(super) estimate: f64,
    /// Which reach, in the order in which they were found.
    pub(super) reach: u32,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        // The least first; among equals the one found first.
        other.estimate.total_cmp(&self.estimate).then(other.reach.cmp(&self.reach))
    }
}

/// What a search writes down. Kept from one search to the next, since most of what planning costs
/// is to get memory; entries count if they bear the number of the search.
#[derive(Default)]
pub(super) struct Workspace {
    pub(super) search: u32,
    pub(super) queue: BinaryHeap<Waiting>,
    pub(super) reaches: Vec<Reach>,
    /// Where the reach that is looked at leads: at most two sides as seen from its root, and both
    /// from either end.
    pub(super) next: Vec<Reach>,
    pub(super) turns: Vec<Turn>,
    /// The shortest way known to each corner.
    pub(super) best: Vec<(u32, f64)>,
    /// Blocks that ways may lead through.
    pub(super) open: Vec<u32>,
}

impl Workspace {
    pub(super) fn begin(&mut self, mesh: &Mesh) {
        self.queue.clear();
        self.reaches.clear();
        self.next.clear();
        self.turns.clear();
        self.search = self.search.wrapping_add(1);
        if self.search == 0 {
            // After four billion searches.
            *self = Self { search: 1, ..Self::default() };
        }
        // Of another mesh there may be more: the number of the search tells them apart.
        self.best.resize(self.best.len().max(mesh.corner_count), (0, f64::INFINITY));
        self.open.resize(self.open.len().max(mesh.blocks.len()), 0);
    }

    pub(super) fn end(&mut self) {
        if self.reaches.capacity() > KEPT_REACHES {
            (self.queue, self.reaches, self.turns) = Default::default();
        }
    }
}
