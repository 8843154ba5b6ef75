//! Rectangles of local free space (paper, section III-B-3; after Gao et al., JFR 2018).

use crate::grid::{Cell, CellState, OccupancyGrid};
use crate::pose::Point2;
use fht_proto::{FixedPoint, Rect};
use serde::{Deserialize, Serialize};

/// Parameters of the rectangles.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct FreeRectangleConfig {
    /// Farthest that a rectangle reaches from its node on each side, metres. Default 7: the LiDAR's
    /// range.
    pub longest_reach_m: f64,
}

impl Default for FreeRectangleConfig {
    fn default() -> Self {
        Self { longest_reach_m: 7.0 }
    }
}

/// Whether something stands in a rectangle by now: a cell whose centre lies in it is occupied.
#[must_use]
pub fn is_obstructed(grid: &OccupancyGrid, node: FixedPoint, rect: &Rect) -> bool {
    let (min, max) = (rect.min(node), rect.max(node));
    // Reaches are whole millimetres and rounded down, so that a border may cut a cell but never
    // reaches its centre.
    let low = grid.cell_of(Point2::new(min.0, min.1));
    let high = grid.cell_of(Point2::new(max.0, max.1));
    let is_inside = |cell: Cell| {
        let centre = grid.centre(cell);
        (min.0..=max.0).contains(&centre.x) && (min.1..=max.1).contains(&centre.y)
    };
    let mut cells = (low.j..=high.j).flat_map(|j| (low.i..=high.i).map(move |i| Cell { i, j }));
    cells.any(|cell| grid.state(cell) == CellState::Occupied && is_inside(cell))
}

/// Grows a rectangle around a node, a row of cells on each side in turn, as long as all cells of
/// the row are free. Unknown cells are not free, and those in doubt neither. `None` if the node
/// itself is not on a free cell.
#[must_use]
pub fn grow(grid: &OccupancyGrid, node: FixedPoint, config: &FreeRectangleConfig) -> Option<Rect> {
    let is_free = |i: i32, j: i32| grid.is_surely_free(Cell { i, j });
    let seed = grid.cell_of(Point2::new(node.x(), node.y()));
    if grid.state(seed) != CellState::Free {
        return None;
    }
    let (mut low, mut high) = (seed, seed);
    let reach = (config.longest_reach_m / grid.resolution_m()).floor() as i32;
    let mut open = [true; 4];
    while open.contains(&true) {
        for (side, is_open) in open.iter_mut().enumerate().filter(|(_, is_open)| **is_open) {
            let (mut next_low, mut next_high) = (low, high);
            let row_is_free = match side {
                0 => {
                    next_low.i -= 1;
                    (low.j..=high.j).all(|j| is_free(next_low.i, j))
                }
                1 => {
                    next_low.j -= 1;
                    (low.i..=high.i).all(|i| is_free(i, next_low.j))
                }
                2 => {
                    next_high.i += 1;
                    (low.j..=high.j).all(|j| is_free(next_high.i, j))
                }
                _ => {
                    next_high.j += 1;
                    (low.i..=high.i).all(|i| is_free(i, next_high.j))
                }
            };
            let is_within = seed.i - next_low.i <= reach
                && seed.j - next_low.j <= reach
                && next_high.i - seed.i <= reach
                && next_high.j - seed.j <= reach;
            if row_is_free && is_within {
                (low, high) = (next_low, next_high);
            } else {
                *is_open = false;
            }
        }
    }
    let metres = |index: i32| f64::from(index) * grid.resolution_m();
    Some(Rect::around(node, (metres(low.i), metres(low.j)), (metres(high.i + 1), metres(high.j + 1))))
}
