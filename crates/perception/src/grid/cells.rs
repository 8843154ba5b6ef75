//! Cells by their indices, and boxes of them.

/// Index of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// Along x.
    pub i: i32,
    /// Along y.
    pub j: i32,
}

/// A box of cells: `min` inclusive, `max` exclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellBounds {
    /// Least indices.
    pub min: Cell,
    /// One past the greatest indices.
    pub max: Cell,
}

impl CellBounds {
    /// No cell.
    pub const EMPTY: Self = Self { min: Cell { i: 0, j: 0 }, max: Cell { i: 0, j: 0 } };

    /// The cells that are in both boxes; [`EMPTY`](Self::EMPTY) if there are none.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let min = Cell { i: self.min.i.max(other.min.i), j: self.min.j.max(other.min.j) };
        let max = Cell { i: self.max.i.min(other.max.i), j: self.max.j.min(other.max.j) };
        if min.i < max.i && min.j < max.j { Self { min, max } } else { Self::EMPTY }
    }

    /// Whether the box contains `cell`.
    #[must_use]
    pub fn contains(&self, cell: Cell) -> bool {
        (self.min.i..self.max.i).contains(&cell.i) && (self.min.j..self.max.j).contains(&cell.j)
    }

    /// Cells along x.
    #[must_use]
    pub fn width(&self) -> usize {
        (self.max.i - self.min.i).max(0) as usize
    }

    /// Cells along y.
    #[must_use]
    pub fn height(&self) -> usize {
        (self.max.j - self.min.j).max(0) as usize
    }

    /// Row-major place of a cell inside the box.
    #[must_use]
    pub fn index(&self, cell: Cell) -> Option<usize> {
        self.contains(cell).then(|| (cell.j - self.min.j) as usize * self.width() + (cell.i - self.min.i) as usize)
    }

    /// The cell at a row-major place.
    #[must_use]
    pub fn cell(&self, index: usize) -> Cell {
        let width = self.width().max(1);
        Cell { i: self.min.i + (index % width) as i32, j: self.min.j + (index / width) as i32 }
    }
}
