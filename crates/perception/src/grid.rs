//! Occupancy grid with ray-traced free space.
//!
//! Cells are anchored to the frame's origin: cell (i, j) covers `[i, i+1) × [j, j+1)` times the
//! resolution, so an index means the same place however the grid grows.
//!
//! | module | idea |
//! | --- | --- |
//! | `cells` | cells by their indices, and boxes of them |
//! | `scans` | scans drawn into the grid, beam by beam |
//! | `suppositions` | what is supposed of cells without a scan |
//! | `growth` | the grid grows with what is seen, within bounds |
//! | `corridors` | straight ways for a robot with a width |

mod cells;
mod corridors;
mod growth;
mod scans;
mod suppositions;

pub use cells::{Cell, CellBounds};

use crate::pose::Point2;
use serde::{Deserialize, Serialize};

/// How scans become cells.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct GridConfig {
    /// Side of a cell, metres. Default 0.05 (paper).
    #[cfg_attr(feature = "schema", schemars(range(min = 0.005, max = 1.0)))]
    pub resolution_m: f64,
    /// Added to a cell's log-odds when a beam ends in it. Default 0.9.
    pub hit_log_odds: f32,
    /// Added to a cell's log-odds when a beam passes through it. Default -0.4.
    pub miss_log_odds: f32,
    /// Log-odds stay within ± this, so that the grid can change its mind. Default 4.
    pub max_log_odds: f32,
    /// A cell is occupied above this and free below its negative. Default 0.35.
    pub decided_log_odds: f32,
    /// Beams are used up to this length, metres; what is farther is too blurred by the beam's width
    /// and the heading's error. Default 30.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.1, max = 1000.0)))]
    pub max_range_m: f64,
    /// A beam without return frees at most this much, metres: glass and dark walls return nothing
    /// either. Default 7 (the paper's LiDAR).
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

/// An occupancy grid that grows with what is seen.
#[derive(Clone, Debug)]
pub struct OccupancyGrid {
    config: GridConfig,
    bounds: CellBounds,
    log_odds: Vec<f32>,
    /// Of the scans that said something of a cell, how many had a beam end in it and how many
    /// passed it; both are halved when one is full.
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
        Self { config, bounds: CellBounds::EMPTY, log_odds: Vec::new(), seen: Vec::new() }
    }

    /// A grid of which only the states of the cells in `bounds` are known, row by row; those that
    /// lack are unknown.
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

    /// Whether a cell is free beyond doubt: as if five scans had passed it and none ended in it,
    /// and beams of fewer than one scan in ten ever did. Of a cell that a wall's corner stands out
    /// into, or that a thin pole stands in, some beams say this and some that.
    #[must_use]
    pub fn is_surely_free(&self, cell: Cell) -> bool {
        self.bounds.index(cell).is_some_and(|index| {
            let Seen { ended, passed } = self.seen[index];
            self.log_odds[index] <= self.doubt() && (ended < 2 || u16::from(ended) * 9 < u16::from(passed))
        })
    }

    /// Whether a cell is free, but not beyond doubt ([`is_surely_free`](Self::is_surely_free)),
    /// because too few scans of this robot's own have passed it: more of them would tell.
    #[must_use]
    pub fn is_barely_free(&self, cell: Cell) -> bool {
        self.state(cell) == CellState::Free
            && self.bounds.index(cell).is_some_and(|index| {
                let Seen { ended, passed } = self.seen[index];
                self.log_odds[index] > self.doubt() && passed > 0 && ended < 2
            })
    }

    /// What is free beyond doubt has log-odds of at most this: five scans passed, less half of one
    /// for rounding.
    fn doubt(&self) -> f32 {
        4.5 * self.config.miss_log_odds
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

    /// Whether a scan of this robot's own has said something of a cell
    /// ([`integrate`](Self::integrate)).
    #[must_use]
    pub fn is_own(&self, cell: Cell) -> bool {
        self.bounds.index(cell).is_some_and(|index| self.seen[index].ended > 0 || self.seen[index].passed > 0)
    }
}

#[cfg(test)]
mod tests;
