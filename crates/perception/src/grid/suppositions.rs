//! What is supposed of cells without a scan: the word of others, and what planning is told.

use super::growth::MAX_CELL;
use super::{Cell, OccupancyGrid, Seen};
use crate::pose::Point2;

impl OccupancyGrid {
    /// Takes another's word that the cells whose centres lie between two corners are free. It
    /// counts as much as one beam, and only where nothing is known yet.
    pub fn suppose_free(&mut self, min: Point2, max: Point2) {
        let is_near = |value: f64| value.is_finite() && value.abs() / self.config.resolution_m < f64::from(MAX_CELL);
        if ![min.x, min.y, max.x, max.y].into_iter().all(is_near) {
            return;
        }
        self.grow_to_contain(self.cell_of(min));
        self.grow_to_contain(self.cell_of(max));
        let half = nalgebra::Vector2::repeat(0.5 * self.config.resolution_m);
        let (low, high) = (self.cell_of(min + half), self.cell_of(max - half));
        for j in low.j..=high.j {
            for i in low.i..=high.i {
                if let Some(index) = self.bounds.index(Cell { i, j })
                    && self.log_odds[index] == 0.0
                {
                    self.log_odds[index] = self.config.miss_log_odds;
                }
            }
        }
    }

    /// Takes the cells for occupied whose centres lie between two corners and in `is_in`, whatever
    /// is known of them: a word for planning, on a copy of the grid. They do not count as seen by
    /// this robot, and what lies beyond the grid's bounds stays unknown.
    pub fn suppose_occupied(&mut self, min: Point2, max: Point2, is_in: impl Fn(Point2) -> bool) {
        let (low, high, bounds) = (self.cell_of(min), self.cell_of(max), self.bounds);
        for j in low.j.max(bounds.min.j)..=high.j.min(bounds.max.j - 1) {
            for i in low.i.max(bounds.min.i)..=high.i.min(bounds.max.i - 1) {
                let cell = Cell { i, j };
                if let Some(index) = bounds.index(cell)
                    && is_in(self.centre(cell))
                {
                    self.log_odds[index] = self.config.max_log_odds;
                }
            }
        }
    }

    /// Forgets that cells are free, but for those of which `is_said` holds.
    pub fn forget_free(&mut self, is_said: impl Fn(Cell) -> bool) {
        for (index, (log_odds, seen)) in self.log_odds.iter_mut().zip(&mut self.seen).enumerate() {
            if *log_odds < -self.config.decided_log_odds && !is_said(self.bounds.cell(index)) {
                (*log_odds, *seen) = (0.0, Seen::default());
            }
        }
    }
}
