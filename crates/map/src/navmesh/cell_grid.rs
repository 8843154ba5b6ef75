//! Things by place: a grid of square cells, each with the numbers of the things that reach into it.

use crate::navmesh::plane::Corner;

/// A box: its least and its greatest corner.
pub(crate) type Extent = [Corner; 2];

/// So many cells there are at most for each thing; fewer if things are long.
const CELLS_PER_THING: usize = 2;
/// A thing stands in so many cells at most, on average: otherwise cells are made larger.
const ENTRIES_PER_THING: usize = 8;

/// The cells around everything.
#[derive(Clone, Debug, Default)]
pub(crate) struct CellGrid {
    low: Corner,
    cell_mm: f64,
    columns: usize,
    rows: usize,
    /// Where in `entries` each cell begins; one more than there are cells.
    begins: Vec<u32>,
    /// Numbers of things, ascending in each cell.
    entries: Vec<u32>,
}

impl CellGrid {
    /// Things by the boxes around them; their numbers count from 0.
    pub(crate) fn of(extents: &[Extent]) -> Self {
        let Some(first) = extents.first() else { return Self::default() };
        let [mut low, mut high] = *first;
        for extent in extents {
            for axis in 0..2 {
                low[axis] = low[axis].min(extent[0][axis]);
                high[axis] = high[axis].max(extent[1][axis]);
            }
        }
        let (width, height) = (high[0] - low[0] + 1.0, high[1] - low[1] + 1.0);
        let most = (CELLS_PER_THING * extents.len()) as f64;
        // As many squares as allowed, whatever the shape of the whole.
        let mut cell_mm = (width * height / most).sqrt().max(width.max(height) / most).max(1.0);
        loop {
            let (columns, rows) = ((width / cell_mm).ceil() as usize, (height / cell_mm).ceil() as usize);
            let mut cells = Self { low, cell_mm, columns: columns.max(1), rows: rows.max(1), ..Self::default() };
            let count = |extent: &Extent| {
                let [from, to] = cells.span(extent);
                (to[0] - from[0] + 1) * (to[1] - from[1] + 1)
            };
            let is_fine = extents.iter().map(count).sum::<usize>() <= ENTRIES_PER_THING * extents.len();
            if is_fine || cells.columns * cells.rows == 1 {
                cells.fill(extents);
                return cells;
            }
            cell_mm *= 2.0;
        }
    }

    fn fill(&mut self, extents: &[Extent]) {
        let mut counts = vec![0_u32; self.columns * self.rows + 1];
        for extent in extents {
            self.each_cell(extent, |cell| counts[cell + 1] += 1);
        }
        for cell in 1..counts.len() {
            counts[cell] += counts[cell - 1];
        }
        self.begins.clone_from(&counts);
        let mut entries = vec![0; counts.last().map_or(0, |count| *count as usize)];
        for (number, extent) in (0_u32..).zip(extents) {
            self.each_cell(extent, |cell| {
                entries[counts[cell] as usize] = number;
                counts[cell] += 1;
            });
        }
        self.entries = entries;
    }

    /// The first and the last column and row that a box reaches into; those at the edge if it lies
    /// outside.
    fn span(&self, [low, high]: &Extent) -> [[usize; 2]; 2] {
        [low, high].map(|corner| {
            let cell = |axis: usize, count: usize| {
                let cell = (corner[axis] - self.low[axis]) / self.cell_mm;
                (cell.max(0.0) as usize).min(count - 1)
            };
            [cell(0, self.columns), cell(1, self.rows)]
        })
    }

    fn each_cell(&self, extent: &Extent, mut visit: impl FnMut(usize)) {
        let [from, to] = self.span(extent);
        for row in from[1]..=to[1] {
            for column in from[0]..=to[0] {
                visit(row * self.columns + column);
            }
        }
    }

    /// The numbers of all things that may contain a place, ascending.
    pub(crate) fn at(&self, place: Corner) -> &[u32] {
        if self.columns == 0 {
            return &[];
        }
        let [[column, row], _] = self.span(&[place, place]);
        self.in_cell(row * self.columns + column)
    }

    fn in_cell(&self, cell: usize) -> &[u32] {
        let range = self.begins[cell] as usize..self.begins[cell + 1] as usize;
        &self.entries[range]
    }

    /// The numbers of all things that may reach into a box, ascending, each once.
    pub(crate) fn within(&self, extent: &Extent) -> Vec<u32> {
        let mut found = Vec::new();
        if self.columns > 0 {
            self.each_cell(extent, |cell| found.extend_from_slice(self.in_cell(cell)));
            found.sort_unstable();
            found.dedup();
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_reaches_into_a_place_is_found_there() {
        let extents: Vec<Extent> = (0..100)
            .map(|number| {
                let (x, y) = (f64::from(number % 10) * 1000.0, f64::from(number / 10) * 700.0);
                [[x, y], [x + 1500.0, y + 300.0]]
            })
            .collect();
        let cells = CellGrid::of(&extents);
        let overlaps = |number: u32, extent: &Extent| {
            let [low, high] = extents[number as usize];
            (0..2).all(|axis| low[axis] <= extent[1][axis] && high[axis] >= extent[0][axis])
        };
        for place in [[0.0, 0.0], [5000.0, 2900.0], [10_500.0, 6600.0], [-50.0, 100.0], [1e9, -1e9]] {
            let expected: Vec<u32> = (0..100).filter(|number| overlaps(*number, &[place, place])).collect();
            assert!(expected.iter().all(|number| cells.at(place).contains(number)), "{place:?}");
        }
        let room = [[900.0, 900.0], [4000.0, 3000.0]];
        let found = cells.within(&room);
        assert!(found.is_sorted());
        assert!((0..100).filter(|number| overlaps(*number, &room)).all(|number| found.contains(&number)));
    }

    #[test]
    fn long_things_far_apart_take_few_cells() {
        let extents: Vec<Extent> = (0..1000)
            .map(|number| {
                let at = f64::from(number) * 2e5;
                [[-1e8, at], [1e8, at + 10.0]]
            })
            .chain([[[0.0, -1e8], [1.0, 1e8]]])
            .collect();
        let cells = CellGrid::of(&extents);
        assert!(cells.entries.len() <= ENTRIES_PER_THING * extents.len() && cells.begins.len() < 4 * extents.len());
        assert!(CellGrid::of(&[]).at([0.0, 0.0]).is_empty() && CellGrid::of(&[]).within(&[[0.0; 2]; 2]).is_empty());
    }
}
