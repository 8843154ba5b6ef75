//! What an explorer has seen, coarsely, as it tells others ([`SeenArea`]) and as it looks up what they told.

use fht_proto::{AuthorId, SeenArea};
use fht_robot::grid::{Cell, CellBounds, OccupancyGrid};

/// Cells along the side of a square: 0.2 m.
const CELLS_PER_SQUARE: i32 = 4;

/// What another explorer has seen, for cells of this robot's grid.
#[derive(Clone, Debug)]
pub struct SeenSquares {
    cells_per_square: i32,
    bounds: CellBounds,
    squares: Vec<bool>,
}

impl SeenSquares {
    /// What another tells, for a grid of this resolution (metres). `None` if its squares are no whole numbers of cells.
    #[must_use]
    pub fn new(area: &SeenArea, resolution_m: f64) -> Option<Self> {
        let cells = f64::from(area.square_mm) / (1000.0 * resolution_m);
        let cells_per_square = cells.round() as i32;
        if cells_per_square < 1 || (cells - f64::from(cells_per_square)).abs() > 1e-6 {
            return None;
        }
        let min = Cell { i: area.west, j: area.south };
        let height = i32::try_from(area.height()).ok()?;
        let max = Cell { i: area.west + i32::from(area.width), j: area.south + height };
        Some(Self { cells_per_square, bounds: CellBounds { min, max }, squares: area.squares().collect() })
    }

    /// Whether the square of a cell was seen.
    #[must_use]
    pub fn has(&self, cell: Cell) -> bool {
        let square = Cell { i: cell.i.div_euclid(self.cells_per_square), j: cell.j.div_euclid(self.cells_per_square) };
        self.bounds.index(square).is_some_and(|index| self.squares.get(index).copied().unwrap_or(false))
    }
}

/// What this robot's own scans have shown, for others: a square is seen when something is known of some cell in it. `upto` is the number of
/// the newest increment written. `None` before anything was seen, and if the area is larger than can be told.
#[must_use]
pub fn seen_area(grid: &OccupancyGrid, author: AuthorId, upto: u64) -> Option<SeenArea> {
    let bounds = grid.bounds();
    let square = |cell: i32| cell.div_euclid(CELLS_PER_SQUARE);
    let min = Cell { i: square(bounds.min.i), j: square(bounds.min.j) };
    let max = Cell { i: square(bounds.max.i - 1) + 1, j: square(bounds.max.j - 1) + 1 };
    let squares = CellBounds { min, max };
    let mut seen = vec![false; squares.width() * squares.height()];
    for j in bounds.min.j..bounds.max.j {
        for i in bounds.min.i..bounds.max.i {
            if grid.is_own(Cell { i, j })
                && let Some(index) = squares.index(Cell { i: square(i), j: square(j) })
            {
                seen[index] = true;
            }
        }
    }
    if !seen.contains(&true) || seen.len() as u64 > SeenArea::MAX_SQUARES {
        return None;
    }
    Some(SeenArea {
        author,
        upto,
        square_mm: (grid.resolution_m() * 1000.0).round() as u16 * CELLS_PER_SQUARE as u16,
        west: min.i,
        south: min.j,
        width: u16::try_from(squares.width()).ok()?,
        runs: SeenArea::runs_of(seen),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::validate::Validate;
    use fht_robot::frame::LaserScan;
    use fht_robot::grid::{CellState, GridConfig};
    use fht_robot::pose::pose;

    #[test]
    fn others_learn_what_was_seen_and_not_what_was_told() {
        let scan = LaserScan {
            base_from_sensor: pose(0.0, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: std::f64::consts::TAU / 360.0,
            range_min_m: 0.1,
            range_max_m: 7.0,
            ranges_m: vec![2.0; 360],
        };
        let mut grid = OccupancyGrid::new(GridConfig::default());
        assert!(seen_area(&grid, AuthorId(1), 0).is_none());
        grid.integrate(&pose(-3.0, 1.0, 0.0), &scan);
        grid.integrate_told(&pose(8.0, 1.0, 0.0), &scan);
        let area = seen_area(&grid, AuthorId(1), 5).expect("something was seen");
        assert!(area.validate().is_ok() && area.upto == 5);
        let seen = SeenSquares::new(&area, grid.resolution_m()).expect("it fits the grid");
        let bounds = grid.bounds();
        for cell in (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index)) {
            if grid.is_own(cell) {
                assert!(seen.has(cell), "{cell:?}");
            }
        }
        let told = grid.cell_of(fht_robot::pose::Point2::new(8.0, 1.0));
        assert!(grid.state(told) == CellState::Free && !seen.has(told));
    }
}
