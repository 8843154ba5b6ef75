//! Which cells ways join: obstacles part the cells where a robot may be into regions.

use fht_perception::grid::{Cell, CellBounds};

/// The region of each cell, from 1; 0 where a robot may not be.
#[derive(Clone, Debug)]
pub(super) struct Regions(Vec<u32>);

impl Regions {
    /// The regions of cells with weights, in the order of `bounds`: a robot may not be where the
    /// weight is 0.
    pub(super) fn of(bounds: &CellBounds, weights: &[u8]) -> Self {
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
                // A diagonal step needs both cells beside it: straight steps lead there, too.
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

    /// The region of a cell of this index, if a robot may be there.
    pub(super) fn region(&self, index: usize) -> Option<u32> {
        Some(self.0[index]).filter(|region| *region > 0)
    }

    /// The regions of all cells in the order of the bounds, from 1; 0 where a robot may not be.
    pub(super) fn all(&self) -> &[u32] {
        &self.0
    }
}
