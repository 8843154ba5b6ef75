//! A grid grows with what is seen, within bounds.

use super::{Cell, CellBounds, GridConfig, OccupancyGrid, Seen};

/// The grid grows in steps of this many cells.
const GROWTH_CELLS: i32 = 128;
/// Farthest cell from the origin; beams beyond are ignored (100 km would not fit memory anyway).
pub(super) const MAX_CELL: i32 = 20_000;

/// A grid grows to so many cells at most: 400 m by 400 m of 0.05 m, 384 MB.
pub(super) const MAX_CELLS: usize = 64_000_000;

impl OccupancyGrid {
    /// An empty grid that has room for what is in `bounds`.
    #[must_use]
    pub fn within(config: GridConfig, bounds: CellBounds) -> Self {
        Self::from_states(config, bounds, [])
    }

    /// What is known of the cells of `region`; all others are unknown.
    #[must_use]
    pub fn part(&self, region: CellBounds) -> Self {
        let bounds = self.bounds.intersection(&region);
        let rows = (bounds.min.j..bounds.max.j).filter_map(|j| self.bounds.index(Cell { i: bounds.min.i, j }));
        let (mut log_odds, mut seen) = (Vec::new(), Vec::new());
        for start in rows {
            log_odds.extend_from_slice(&self.log_odds[start..start + bounds.width()]);
            seen.extend_from_slice(&self.seen[start..start + bounds.width()]);
        }
        Self { config: self.config.clone(), bounds, log_odds, seen }
    }

    pub(super) fn grow_to_contain(&mut self, cell: Cell) {
        if self.bounds.contains(cell) {
            return;
        }
        let down = |index: i32| index.div_euclid(GROWTH_CELLS) * GROWTH_CELLS;
        let up = |index: i32| down(index) + GROWTH_CELLS;
        let empty = self.log_odds.is_empty();
        let old = self.bounds;
        let bounds = CellBounds {
            min: Cell {
                i: if empty { down(cell.i) } else { old.min.i.min(down(cell.i)) },
                j: if empty { down(cell.j) } else { old.min.j.min(down(cell.j)) },
            },
            max: Cell {
                i: if empty { up(cell.i) } else { old.max.i.max(up(cell.i)) },
                j: if empty { up(cell.j) } else { old.max.j.max(up(cell.j)) },
            },
        };
        if bounds.width() * bounds.height() > MAX_CELLS {
            return; // what lies outside stays unknown
        }
        let mut log_odds = vec![0.0; bounds.width() * bounds.height()];
        let mut seen = vec![Seen::default(); log_odds.len()];
        if !empty {
            for (row, values) in self.log_odds.chunks_exact(old.width()).enumerate() {
                let first = Cell { i: old.min.i, j: old.min.j + row as i32 };
                if let Some(at) = bounds.index(first) {
                    log_odds[at..at + values.len()].copy_from_slice(values);
                    seen[at..at + values.len()].copy_from_slice(&self.seen[row * old.width()..][..old.width()]);
                }
            }
        }
        self.bounds = bounds;
        self.log_odds = log_odds;
        self.seen = seen;
    }
}
