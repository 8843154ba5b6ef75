//! What an explorer has seen, coarsely, as it tells others ([`SeenArea`]) and as it looks up what
//! they told.

use fht_perception::grid::{Cell, CellBounds, CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::{AuthorId, SeenArea, Square};

/// Cells along the side of a square: 0.1 m, unless that were more squares than can be told. Larger
/// ones close narrow doors.
const CELLS_PER_SQUARE: i32 = 2;

/// Cells that an area may span, seen or not: what is told of may make a grid grow. 64 million: 400
/// m by 400 m.
const MOST_CELLS: u64 = 64_000_000;

/// What another explorer has seen, for cells of this robot's grid.
#[derive(Clone, Debug)]
pub struct SeenSquares {
    author: AuthorId,
    square_m: f64,
    cells_per_square: i32,
    bounds: CellBounds,
    squares: Vec<Square>,
}

impl SeenSquares {
    /// What another tells, for a grid of this resolution (metres). `None` if its squares are no
    /// whole numbers of cells, or span a larger area than any building.
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
        let cells = |squares: u64| squares * u64::from(cells_per_square.unsigned_abs());
        if cells(area.width.into()).saturating_mul(cells(area.height() as u64)) > MOST_CELLS {
            return None;
        }
        let bounds = CellBounds { min, max };
        let square_m = f64::from(area.square_mm) * 1e-3;
        Some(Self { author: area.author, square_m, cells_per_square, bounds, squares: area.squares().collect() })
    }

    /// Who has seen it.
    #[must_use]
    pub fn author(&self) -> AuthorId {
        self.author
    }

    /// What was told of the square of a place.
    #[must_use]
    pub fn square_at(&self, place: Point2) -> Square {
        let index = |metres: f64| (metres / self.square_m).floor() as i32;
        self.of_square(Cell { i: index(place.x), j: index(place.y) })
    }

    /// What was told of the square of a cell.
    #[must_use]
    pub fn square(&self, cell: Cell) -> Square {
        self.of_square(square_of(cell, self.cells_per_square))
    }

    fn of_square(&self, square: Cell) -> Square {
        self.bounds.index(square).and_then(|index| self.squares.get(index).copied()).unwrap_or_default()
    }

    /// Takes its word for free squares, where `grid` knows nothing yet, but for those that are in
    /// doubt.
    pub fn draw_free_space(&self, grid: &mut OccupancyGrid, is_doubted: impl Fn(Point2) -> bool) {
        let corner = |i: i32, j: i32| Point2::new(f64::from(i) * self.square_m, f64::from(j) * self.square_m);
        for (index, _) in self.squares.iter().enumerate().filter(|(_, square)| **square == Square::Free) {
            let Cell { i, j } = self.bounds.cell(index);
            let (low, high) = (corner(i, j), corner(i + 1, j + 1));
            if !is_doubted(nalgebra::center(&low, &high)) {
                grid.suppose_free(low, high);
            }
        }
    }
}

fn square_of(cell: Cell, cells_per_square: i32) -> Cell {
    Cell { i: cell.i.div_euclid(cells_per_square), j: cell.j.div_euclid(cells_per_square) }
}

/// What this robot's own scans have shown, for others: a square is occupied when some cell in it
/// is, and free when some other cell in it is known. `upto` is the number of the newest increment
/// written. `None` before anything was seen, and if the area is larger than can be told.
#[must_use]
pub fn seen_area(grid: &OccupancyGrid, author: AuthorId, upto: u64) -> Option<SeenArea> {
    let squares_of = |cells_per_square: i32| {
        let (min, last) = (grid.bounds().min, grid.bounds().max);
        let last = square_of(Cell { i: last.i - 1, j: last.j - 1 }, cells_per_square);
        CellBounds { min: square_of(min, cells_per_square), max: Cell { i: last.i + 1, j: last.j + 1 } }
    };
    let is_few = |bounds: &CellBounds| (bounds.width() * bounds.height()) as u64 <= SeenArea::MAX_SQUARES;
    let cells_per_square = (0..4).map(|power| CELLS_PER_SQUARE << power).find(|cells| is_few(&squares_of(*cells)))?;
    let (bounds, squares) = (grid.bounds(), squares_of(cells_per_square));
    let mut seen = vec![Square::Unseen; squares.width() * squares.height()];
    for cell in (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index)) {
        let said = match grid.state(cell) {
            CellState::Occupied => Square::Occupied,
            CellState::Free => Square::Free,
            CellState::Unknown => continue,
        };
        if let Some(index) = squares.index(square_of(cell, cells_per_square)).filter(|_| grid.is_own(cell))
            && seen[index] != Square::Occupied
        {
            seen[index] = said;
        }
    }
    if seen.iter().all(|square| *square == Square::Unseen) {
        return None;
    }
    Some(SeenArea {
        author,
        upto,
        square_mm: u16::try_from((grid.resolution_m() * 1000.0).round() as i32 * cells_per_square).ok()?,
        west: squares.min.i,
        south: squares.min.j,
        width: u16::try_from(squares.width()).ok()?,
        runs: SeenArea::runs_of(seen),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::frame::LaserScan;
    use fht_perception::grid::GridConfig;
    use fht_perception::pose::pose;
    use fht_proto::model::validate::Validate;

    #[test]
    fn areas_larger_than_buildings_are_not_taken() {
        let area = |width: u16, rows: u32| SeenArea {
            author: AuthorId(1),
            upto: 1,
            square_mm: 2000,
            west: -10,
            south: -10,
            width,
            runs: vec![fht_proto::Run { square: Square::Free, length: u32::from(width) * rows }],
        };
        assert!(area(1999, 2000).validate().is_ok());
        assert!(SeenSquares::new(&area(1999, 2000), 0.05).is_none());
        assert!(SeenSquares::new(&area(100, 100), 0.05).is_some());
    }

    #[test]
    fn others_learn_what_was_seen_and_not_what_was_told() {
        let scan = LaserScan::all_round(360, |_, _| 2.0);
        let mut grid = OccupancyGrid::new(GridConfig::default());
        assert!(seen_area(&grid, AuthorId(1), 0).is_none());
        grid.integrate(&pose(-3.0, 1.0, 0.0), &scan);
        grid.integrate_told(&pose(8.0, 1.0, 0.0), &scan);
        let area = seen_area(&grid, AuthorId(1), 5).expect("something was seen");
        assert!(area.validate().is_ok() && area.upto == 5);
        let seen = SeenSquares::new(&area, grid.resolution_m()).expect("it fits the grid");
        let bounds = grid.bounds();
        for cell in (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index)) {
            match grid.state(cell) {
                _ if !grid.is_own(cell) => {}
                CellState::Unknown => {}
                CellState::Occupied => assert_eq!(seen.square(cell), Square::Occupied, "{cell:?}"),
                CellState::Free => assert_ne!(seen.square(cell), Square::Unseen, "{cell:?}"),
            }
        }
        let told = grid.cell_of(fht_perception::pose::Point2::new(8.0, 1.0));
        assert!(grid.state(told) == CellState::Free && seen.square(told) == Square::Unseen);
    }
}
