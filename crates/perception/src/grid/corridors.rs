//! Straight ways over the grid for a robot with a width.

use super::{Cell, CellState, OccupancyGrid};
use crate::pose::Point2;

impl OccupancyGrid {
    /// Whether a robot of half width `half_width_m` can drive straight from `a` to `b`: every cell
    /// whose centre lies within `half_width_m` of the segment is free. Unknown cells are not free.
    #[must_use]
    pub fn is_corridor_free(&self, a: Point2, b: Point2, half_width_m: f64) -> bool {
        self.all_cells_near(a, b, half_width_m, |state| state == CellState::Free)
    }

    /// Whether no occupied cell's centre lies within `half_width_m` of the segment from `a` to `b`.
    /// Unknown cells pass.
    #[must_use]
    pub fn is_corridor_unoccupied(&self, a: Point2, b: Point2, half_width_m: f64) -> bool {
        self.all_cells_near(a, b, half_width_m, |state| state != CellState::Occupied)
    }

    fn all_cells_near(&self, a: Point2, b: Point2, half_width_m: f64, accept: impl Fn(CellState) -> bool) -> bool {
        // A segment on a border between cells must still touch some.
        let radius = half_width_m.max(0.71 * self.config.resolution_m);
        let along = b - a;
        let length_squared = along.norm_squared();
        let low = self.cell_of(Point2::new(a.x.min(b.x) - radius, a.y.min(b.y) - radius));
        let high = self.cell_of(Point2::new(a.x.max(b.x) + radius, a.y.max(b.y) + radius));
        let resolution = self.config.resolution_m;
        (low.j..=high.j).all(|j| {
            // The segment is convex, so in a row its neighbourhood is one interval; bound it to
            // skip most cells.
            let y = (f64::from(j) + 0.5) * resolution;
            let (i_low, i_high) = if along.y.abs() < 1e-9 {
                (low.i, high.i)
            } else {
                let at = |edge: f64| ((edge - a.y) / along.y).clamp(0.0, 1.0) * along.x + a.x;
                let (x0, x1) = (at(y - radius), at(y + radius));
                let index = |x: f64| (x / resolution).floor() as i32;
                (index(x0.min(x1) - radius).max(low.i), index(x0.max(x1) + radius).min(high.i))
            };
            (i_low..=i_high).all(|i| {
                let centre = self.centre(Cell { i, j });
                let t = if length_squared > 0.0 {
                    ((centre - a).dot(&along) / length_squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                (centre - (a + along * t)).norm_squared() > radius * radius || accept(self.state(Cell { i, j }))
            })
        })
    }
}
