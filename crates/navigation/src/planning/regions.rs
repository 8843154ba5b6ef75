//! Which cells ways join: obstacles part the cells where a robot may be into regions.

use super::{ESCAPE_REACH_M, Traversable};
use fht_perception::grid::{Cell, CellBounds};
use fht_perception::pose::Point2;
use std::collections::BTreeSet;

/// The region of each cell, from 1; 0 where a robot may not be.
#[derive(Clone, Debug)]
pub(super) struct Regions(Vec<u32>);

impl Regions {
    fn of(bounds: &CellBounds, weights: &[u8]) -> Self {
        let mut regions = vec![0; weights.len()];
        let mut count = 0;
        let mut waiting = Vec::new();
        for start in 0..weights.len() {
            if weights[start] == 0 || regions[start] != 0 {
                continue;
            }
            count += 1;
            regions[start] = count;
            waiting.push(start);
            while let Some(index) = waiting.pop() {
                let cell = bounds.cell(index);
                // A diagonal step needs both cells beside it, so that straight steps lead there, too.
                let beside = [(1, 0), (0, 1), (-1, 0), (0, -1)].map(|(i, j)| Cell { i: cell.i + i, j: cell.j + j });
                for next in beside.into_iter().filter_map(|cell| bounds.index(cell)) {
                    if weights[next] > 0 && regions[next] == 0 {
                        regions[next] = count;
                        waiting.push(next);
                    }
                }
            }
        }
        Self(regions)
    }
}

impl Traversable {
    /// All cells are sorted into regions when one is first asked for.
    fn regions(&self) -> &[u32] {
        &self.regions.get_or_init(|| Regions::of(&self.bounds, &self.weights)).0
    }

    /// The region of a cell where a robot may be.
    fn region_of(&self, cell: Cell) -> Option<u32> {
        self.bounds.index(cell).map(|index| self.regions()[index]).filter(|region| *region > 0)
    }

    /// Whether some way leads from a place to a cell, however long: whether
    /// [`distances_from`](Self::distances_from) gets there.
    #[must_use]
    pub fn has_way(&self, from: Point2, to: Cell) -> bool {
        let start = self.nearest_passable(from, ESCAPE_REACH_M).and_then(|cell| self.region_of(cell));
        start.is_some() && start == self.region_of(to)
    }

    /// Of each cell, in the order of the snapshot's bounds, whether a way joins it with one of
    /// `cells`.
    #[must_use]
    pub fn joined_with(&self, cells: impl Iterator<Item = Cell>) -> Vec<bool> {
        let joined: BTreeSet<u32> = cells.filter_map(|cell| self.region_of(cell)).collect();
        self.regions().iter().map(|region| joined.contains(region)).collect()
    }
}
