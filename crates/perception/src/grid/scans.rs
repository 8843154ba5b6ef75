//! Scans drawn into the grid, beam by beam.

use super::growth::MAX_CELL;
use super::{Cell, CellBounds, OccupancyGrid};
use crate::frame::LaserScan;
use crate::pose::{Point2, Pose2};

impl OccupancyGrid {
    /// Adds a scan that another robot took: as [`integrate`](Self::integrate), but the cells do not
    /// count as seen by this robot.
    pub fn integrate_told(&mut self, map_from_base: &Pose2, scan: &LaserScan) {
        self.draw(map_from_base, scan, false);
    }

    /// Adds a scan taken at `map_from_base`: cells on the way of a beam become freer, the cell of
    /// its end more occupied. A cell that some beam of this scan ends in is not freed by the
    /// others, so that thin walls survive grazing beams.
    pub fn integrate(&mut self, map_from_base: &Pose2, scan: &LaserScan) {
        self.draw(map_from_base, scan, true);
    }

    fn draw(&mut self, map_from_base: &Pose2, scan: &LaserScan, is_own: bool) {
        let map_from_sensor = map_from_base * scan.base_from_sensor;
        let origin = Point2::from(map_from_sensor.translation.vector);
        let longest =
            scan.ranges_m.iter().filter(|&&range| scan.is_return(range)).fold(0.0, |a: f64, &b| a.max(b.into()));
        let no_return_m = (scan.range_max_m - self.config.resolution_m).min(self.config.max_no_return_m);
        let reach = longest.min(self.config.max_range_m).max(no_return_m) + 2.0 * self.config.resolution_m;
        let near =
            |value: f64| value.is_finite() && (value.abs() + reach) / self.config.resolution_m < f64::from(MAX_CELL);
        if !near(origin.x) || !near(origin.y) {
            return;
        }
        self.grow_to_contain(self.cell_of(origin - nalgebra::Vector2::repeat(reach)));
        self.grow_to_contain(self.cell_of(origin + nalgebra::Vector2::repeat(reach)));

        let start = self.cell_of(origin);
        let box_m = nalgebra::Vector2::repeat(reach);
        let (low, high) = (self.cell_of(origin - box_m), self.cell_of(origin + box_m));
        let mut hits = CellSet::new(low, high, &self.bounds);
        let mut rays = Vec::with_capacity(scan.ranges_m.len());
        for (index, &range) in scan.ranges_m.iter().enumerate() {
            let is_far = f64::from(range) > self.config.max_range_m;
            let is_return = scan.is_return(range) && !is_far;
            // Below the least range the beam says nothing; NaN neither. Infinite or too far: free
            // up to the greatest.
            let length = if is_return {
                f64::from(range)
            } else if scan.is_return(range) {
                self.config.max_range_m
            } else if f64::from(range) >= scan.range_max_m {
                no_return_m
            } else {
                continue;
            };
            let (sin, cos) = scan.angle(index).sin_cos();
            let end = self.cell_of(map_from_sensor * Point2::new(length * cos, length * sin));
            if is_return {
                hits.insert(end);
            }
            rays.push(end);
        }

        // A cell is freed at most once per scan, however many beams cross it: near the robot
        // hundreds do.
        let mut crossed = CellSet::new(low, high, &self.bounds);
        for end in rays {
            for_each_cell_between(start, end, |cell| crossed.insert(cell));
        }
        let (miss, hit) = (self.config.miss_log_odds, self.config.hit_log_odds);
        crossed.remove_all(&hits);
        let bounds = self.bounds;
        crossed.for_each_index(&bounds, |index| self.take_in(index, miss, is_own.then_some(false)));
        hits.for_each_index(&bounds, |index| self.take_in(index, hit, is_own.then_some(true)));
    }

    /// Adds to a cell's log-odds; `has_ended` says whether one of this robot's own beams ended in
    /// it.
    fn take_in(&mut self, index: usize, amount: f32, has_ended: Option<bool>) {
        let limit = self.config.max_log_odds;
        let value = &mut self.log_odds[index];
        *value = (*value + amount).clamp(-limit, limit);
        if let Some(has_ended) = has_ended {
            self.seen[index].count(has_ended);
        }
    }
}

/// Cells within a box, a bit for each.
struct CellSet {
    within: CellBounds,
    columns: usize,
    rows: usize,
    words_of_row: usize,
    words: Vec<u64>,
}

impl CellSet {
    /// None yet, of those from `low` to `high` that are within `bounds`.
    fn new(low: Cell, high: Cell, bounds: &CellBounds) -> Self {
        let max = Cell { i: high.i + 1, j: high.j + 1 };
        let within = CellBounds { min: low, max }.intersection(bounds);
        let (columns, rows) = (within.width(), within.height());
        let words_of_row = columns.div_ceil(64);
        Self { within, columns, rows, words_of_row, words: vec![0; words_of_row * rows] }
    }

    fn insert(&mut self, cell: Cell) {
        // What lies before the box becomes a number far beyond it.
        let (i, j) = (cell.i.wrapping_sub(self.within.min.i) as u32, cell.j.wrapping_sub(self.within.min.j) as u32);
        if (i as usize) < self.columns && (j as usize) < self.rows {
            self.words[j as usize * self.words_of_row + (i / 64) as usize] |= 1 << (i % 64);
        }
    }

    /// Takes those of another set of the same box out.
    fn remove_all(&mut self, others: &Self) {
        self.words.iter_mut().zip(&others.words).for_each(|(word, other)| *word &= !other);
    }

    /// Visits the cells row by row, as places in `bounds`, which contain the box.
    fn for_each_index(&self, bounds: &CellBounds, mut visit: impl FnMut(usize)) {
        if self.words.is_empty() {
            return;
        }
        let corner = Cell { i: self.within.min.i - bounds.min.i, j: self.within.min.j - bounds.min.j };
        for (row, words) in self.words.chunks_exact(self.words_of_row).enumerate() {
            let first = (corner.j as usize + row) * bounds.width() + corner.i as usize;
            for (number, &word) in words.iter().enumerate() {
                let mut rest = word;
                while rest != 0 {
                    visit(first + number * 64 + rest.trailing_zeros() as usize);
                    rest &= rest - 1;
                }
            }
        }
    }
}

/// Visits the cells from `start` up to but excluding `end` along a straight line (Bresenham).
fn for_each_cell_between(start: Cell, end: Cell, mut visit: impl FnMut(Cell)) {
    let (di, dj) = ((end.i - start.i).abs(), -(end.j - start.j).abs());
    let (step_i, step_j) = ((end.i - start.i).signum(), (end.j - start.j).signum());
    let mut error = di + dj;
    let mut cell = start;
    while cell != end {
        visit(cell);
        let doubled = 2 * error;
        if doubled >= dj {
            error += dj;
            cell.i += step_i;
        }
        if doubled <= di {
            error += di;
            cell.j += step_j;
        }
    }
}
