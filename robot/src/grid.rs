//! Occupancy grid with ray-traced free space.
//!
//! Cells are anchored to the frame's origin: cell (i, j) covers `[i, i+1) × [j, j+1)` times the resolution, so an index
//! means the same place however the grid grows.

use crate::frame::LaserScan;
use crate::pose::{Point2, Pose2};

/// How scans become cells.
#[derive(Clone, Debug)]
pub struct GridConfig {
    /// Side of a cell, metres. Default 0.05 (paper).
    pub resolution_m: f64,
    /// Added to a cell's log-odds when a beam ends in it. Default 0.9.
    pub hit_log_odds: f32,
    /// Added to a cell's log-odds when a beam passes through it. Default -0.4.
    pub miss_log_odds: f32,
    /// Log-odds stay within ± this, so that the grid can change its mind. Default 4.
    pub max_log_odds: f32,
    /// A cell is occupied above this and free below its negative. Default 0.35.
    pub decided_log_odds: f32,
    /// Beams are used up to this length, metres; what is farther is too blurred by the beam's width and the heading's
    /// error. Default 30.
    pub max_range_m: f64,
    /// A beam without return frees at most this much, metres: glass and dark walls return nothing either. Default 7
    /// (the paper's LiDAR).
    pub max_no_return_m: f64,
}

impl Default for GridConfig {
    fn default() -> Self {
        Self {
            resolution_m: 0.05,
            hit_log_odds: 0.9,
            miss_log_odds: -0.4,
            max_log_odds: 4.0,
            decided_log_odds: 0.35,
            max_range_m: 30.0,
            max_no_return_m: 7.0,
        }
    }
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellState {
    /// Nothing, or contradictory things.
    Unknown,
    /// The paper's S_free.
    Free,
    /// The paper's S_occ.
    Occupied,
}

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

/// The grid grows in steps of this many cells.
const GROWTH_CELLS: i32 = 128;
/// Farthest cell from the origin; beams beyond are ignored (100 km would not fit memory anyway).
const MAX_CELL: i32 = 20_000;

/// A grid grows to so many cells at most: 400 m by 400 m of 0.05 m, 384 MB.
const MAX_CELLS: usize = 64_000_000;

/// An occupancy grid that grows with what is seen.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    config: GridConfig,
    bounds: CellBounds,
    log_odds: Vec<f32>,
    /// Of the scans that said something of a cell, how many had a beam end in it and how many passed it; both are halved when
    /// one is full.
    seen: Vec<Seen>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    ended: u8,
    passed: u8,
}

impl Seen {
    fn count(&mut self, has_ended: bool) {
        let counter = if has_ended { &mut self.ended } else { &mut self.passed };
        *counter += 1;
        if *counter == u8::MAX {
            *self = Self { ended: self.ended / 2, passed: self.passed / 2 };
        }
    }
}

impl OccupancyGrid {
    /// An empty grid.
    #[must_use]
    pub fn new(config: GridConfig) -> Self {
        let zero = Cell { i: 0, j: 0 };
        Self { config, bounds: CellBounds { min: zero, max: zero }, log_odds: Vec::new(), seen: Vec::new() }
    }

    /// A grid of which only the states of the cells in `bounds` are known, row by row; those that lack are unknown.
    #[must_use]
    pub fn from_states(config: GridConfig, bounds: CellBounds, states: impl IntoIterator<Item = CellState>) -> Self {
        let certain = config.max_log_odds;
        let of = |state| match state {
            CellState::Unknown => 0.0,
            CellState::Free => -certain,
            CellState::Occupied => certain,
        };
        let count = bounds.width() * bounds.height();
        let mut log_odds: Vec<f32> = states.into_iter().take(count).map(of).collect();
        log_odds.resize(count, 0.0);
        let seen = vec![Seen::default(); count];
        Self { config, bounds, log_odds, seen }
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn resolution_m(&self) -> f64 {
        self.config.resolution_m
    }

    /// The box outside of which everything is unknown.
    #[must_use]
    pub fn bounds(&self) -> CellBounds {
        self.bounds
    }

    /// The cell that contains `point`.
    #[must_use]
    pub fn cell_of(&self, point: Point2) -> Cell {
        let index = |metres: f64| (metres / self.config.resolution_m).floor() as i32;
        Cell { i: index(point.x), j: index(point.y) }
    }

    /// The centre of a cell, metres.
    #[must_use]
    pub fn centre(&self, cell: Cell) -> Point2 {
        let metres = |index: i32| (f64::from(index) + 0.5) * self.config.resolution_m;
        Point2::new(metres(cell.i), metres(cell.j))
    }

    /// What is known of a cell.
    #[must_use]
    pub fn state(&self, cell: Cell) -> CellState {
        match self.bounds.index(cell).map(|index| self.log_odds[index]) {
            Some(value) if value > self.config.decided_log_odds => CellState::Occupied,
            Some(value) if value < -self.config.decided_log_odds => CellState::Free,
            _ => CellState::Unknown,
        }
    }

    /// Whether a cell is free beyond doubt: as if five scans had passed it and none ended in it, and beams of fewer than one scan
    /// in ten ever did. Of a cell that a wall's corner stands out into, or that a thin pole stands in, some beams say this and
    /// some that.
    #[must_use]
    pub fn is_surely_free(&self, cell: Cell) -> bool {
        let doubt = 4.5 * self.config.miss_log_odds; // half a beam for rounding
        self.bounds.index(cell).is_some_and(|index| {
            let Seen { ended, passed } = self.seen[index];
            self.log_odds[index] <= doubt && (ended < 2 || u16::from(ended) * 9 < u16::from(passed))
        })
    }

    /// What is known of the cell that contains `point`.
    #[must_use]
    pub fn state_at(&self, point: Point2) -> CellState {
        self.state(self.cell_of(point))
    }

    /// Area of the free cells, square metres.
    #[must_use]
    pub fn free_area_m2(&self) -> f64 {
        let free = self.log_odds.iter().filter(|&&value| value < -self.config.decided_log_odds).count();
        free as f64 * self.config.resolution_m * self.config.resolution_m
    }

    /// Whether a scan of this robot's own has said something of a cell ([`integrate`](Self::integrate)).
    #[must_use]
    pub fn is_own(&self, cell: Cell) -> bool {
        self.bounds.index(cell).is_some_and(|index| self.seen[index].ended > 0 || self.seen[index].passed > 0)
    }

    /// Takes another's word that the cells whose centres lie between two corners are free. It counts as much as one beam, and only where
    /// nothing is known yet.
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

    /// Takes the cells for occupied whose centres lie between two corners and in `is_in`, whatever is known of them: a word for planning,
    /// on a copy of the grid. They do not count as seen by this robot, and what lies beyond the grid's bounds stays unknown.
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

    /// Adds a scan that another robot took: as [`integrate`](Self::integrate), but the cells do not count as seen by this robot.
    pub fn integrate_told(&mut self, map_from_base: &Pose2, scan: &LaserScan) {
        self.draw(map_from_base, scan, false);
    }

    /// Adds a scan taken at `map_from_base`: cells on the way of a beam become freer, the cell of its end more occupied.
    /// A cell that some beam of this scan ends in is not freed by the others, so that thin walls survive grazing beams.
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
        let mut hits = Vec::new();
        let mut rays = Vec::with_capacity(scan.ranges_m.len());
        for (index, &range) in scan.ranges_m.iter().enumerate() {
            let is_far = f64::from(range) > self.config.max_range_m;
            let is_return = scan.is_return(range) && !is_far;
            // Below the least range the beam says nothing; NaN neither. Infinite or too far: free up to the greatest.
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
                hits.extend(self.bounds.index(end));
            }
            rays.push(end);
        }
        hits.sort_unstable();
        hits.dedup();

        // A cell is freed at most once per scan, however many beams cross it: near the robot hundreds do.
        let mut crossed = Vec::with_capacity(rays.len() * 64);
        for end in rays {
            for_each_cell_between(start, end, |cell| crossed.extend(self.bounds.index(cell)));
        }
        crossed.sort_unstable();
        crossed.dedup();
        for index in crossed {
            if hits.binary_search(&index).is_err() {
                self.add(index, self.config.miss_log_odds);
                if is_own {
                    self.seen[index].count(false);
                }
            }
        }
        for index in hits {
            self.add(index, self.config.hit_log_odds);
            if is_own {
                self.seen[index].count(true);
            }
        }
    }

    fn add(&mut self, index: usize, amount: f32) {
        let limit = self.config.max_log_odds;
        let value = &mut self.log_odds[index];
        *value = (*value + amount).clamp(-limit, limit);
    }

    fn grow_to_contain(&mut self, cell: Cell) {
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

    /// Whether a robot of half width `half_width_m` can drive straight from `a` to `b`: every cell whose centre lies
    /// within `half_width_m` of the segment is free. Unknown cells are not free.
    #[must_use]
    pub fn is_corridor_free(&self, a: Point2, b: Point2, half_width_m: f64) -> bool {
        self.all_cells_near(a, b, half_width_m, |state| state == CellState::Free)
    }

    /// Whether no occupied cell's centre lies within `half_width_m` of the segment from `a` to `b`. Unknown cells pass.
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
            // The segment is convex, so in a row its neighbourhood is one interval; bound it to skip most cells.
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

#[cfg(test)]
mod tests;
