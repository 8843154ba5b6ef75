//! Which ground rectangles cover, and how much a further one would add.

use fht_perception::grid::{Cell, CellBounds, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::{FixedPoint, Rect};

/// Cells that some rectangle covers.
pub(crate) struct Covered {
    bounds: CellBounds,
    cells: Vec<bool>,
    cell_m2: f64,
}

impl Covered {
    /// Nothing yet, on the cells of a grid.
    pub(crate) fn on(grid: &OccupancyGrid) -> Self {
        let bounds = grid.bounds();
        let cells = vec![false; bounds.width() * bounds.height()];
        Self { bounds, cells, cell_m2: grid.resolution_m().powi(2) }
    }

    /// The cells whose centres lie in a rectangle.
    fn inside(grid: &OccupancyGrid, node: FixedPoint, rect: &Rect) -> [Cell; 2] {
        let half = nalgebra::Vector2::repeat(0.5 * grid.resolution_m());
        let (low, high) = (rect.min(node), rect.max(node));
        [grid.cell_of(Point2::new(low.0, low.1) + half), grid.cell_of(Point2::new(high.0, high.1) - half)]
    }

    /// Adds a rectangle.
    pub(crate) fn add(&mut self, grid: &OccupancyGrid, node: FixedPoint, rect: &Rect) {
        let [low, high] = Self::inside(grid, node, rect);
        for j in low.j..=high.j {
            for i in low.i..=high.i {
                if let Some(index) = self.bounds.index(Cell { i, j }) {
                    self.cells[index] = true;
                }
            }
        }
    }

    /// How much a rectangle would add, square metres. What is a cell or two wide is where both maps
    /// drew a wall's border, and counts for nothing.
    pub(crate) fn news_m2(&self, grid: &OccupancyGrid, node: FixedPoint, rect: &Rect) -> f64 {
        let [low, high] = Self::inside(grid, node, rect);
        let is_new = |i: i32, j: i32| {
            let is_inside = (low.i..=high.i).contains(&i) && (low.j..=high.j).contains(&j);
            is_inside && self.bounds.index(Cell { i, j }).is_some_and(|index| !self.cells[index])
        };
        let is_wide = |i: i32, j: i32| (j - 1..=j + 1).all(|j| (i - 1..=i + 1).all(|i| is_new(i, j)));
        let count = (low.j..=high.j).map(|j| (low.i..=high.i).filter(|&i| is_wide(i, j)).count()).sum::<usize>();
        count as f64 * self.cell_m2
    }
}
