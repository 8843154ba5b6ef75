//! Shortest ways over the grid for a robot with a width.
//!
//! A [`Traversable`] is a snapshot of an [`OccupancyGrid`]: which cells the robot's centre may be
//! in, how far each is from the nearest obstacle, and what a metre costs there. It does not borrow
//! the grid, so a planning thread can own it.
//!
//! | module | idea |
//! | --- | --- |
//! | `clearance` | how far each cell is from the nearest obstacle |
//! | `search` | best first over cells: Dijkstra and A* |
//! | `regions` | which cells ways join |
//! | `ways` | the cheapest ways from a place, to one other or to everywhere |
//! | `straight` | straight drives, and paths pulled straight |
//! | `touched_cells` | which cells a segment touches |

mod clearance;
mod regions;
mod search;
mod straight;
mod touched_cells;
mod ways;

pub use ways::{DistanceField, ESCAPE_REACH_M, GridPath, path_length_m};

use fht_perception::grid::{Cell, CellBounds, CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::Footprint;
use regions::Regions;
use search::UNIT_WEIGHT;
use serde::{Deserialize, Serialize};
use std::sync::OnceLock;
use touched_cells::all_cells_between;

/// What the planner takes unknown cells for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum UnknownCells {
    /// Not passable, but the robot may pass beside them (exploration: frontiers are beside unknown
    /// cells).
    Forbidden,
    /// Not passable, and kept at the robot's radius like walls.
    Obstacle,
    /// As passable as free cells (a client with an empty grid of its own).
    Allowed,
}

/// How the grid becomes passable cells and costs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PlanConfig {
    /// The robot's centre keeps more than this from the centre of every occupied cell, metres.
    /// Default 0.15: the robot's 0.105 m and most of a cell ([`Footprint::grid_clearance_m`]).
    pub robot_radius_m: f64,
    /// Nearer to occupied cells than this, a metre costs more, metres. Default 0.35
    /// ([`Footprint::comfort_clearance_m`]).
    pub comfort_clearance_m: f64,
    /// How much more a metre costs at `robot_radius_m`, falling linearly to nothing at
    /// `comfort_clearance_m`: 2 makes it cost three metres. At most 14. Default 2. At 0 the
    /// cheapest path is the shortest.
    pub comfort_weight: f64,
    /// What unknown cells are. Default forbidden.
    pub unknown: UnknownCells,
}

impl Default for PlanConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

impl PlanConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            robot_radius_m: footprint.grid_clearance_m(),
            comfort_clearance_m: footprint.comfort_clearance_m(),
            comfort_weight: 2.0,
            unknown: UnknownCells::Forbidden,
        }
    }

    /// Plain lengths without the comfort cost: what the paper's refinement compares with (section
    /// III-D).
    #[must_use]
    pub fn shortest() -> Self {
        Self { comfort_weight: 0.0, ..Self::default() }
    }
}

/// The cells within `radius_m` of `centre` along each axis, as far as the grid knows any: a path
/// from `centre` that is no longer stays in it.
#[must_use]
pub fn region_around(grid: &OccupancyGrid, centre: Point2, radius_m: f64) -> CellBounds {
    let reach = nalgebra::Vector2::repeat(radius_m.max(0.0));
    let (min, high) = (grid.cell_of(centre - reach), grid.cell_of(centre + reach));
    // Casts saturate: an infinite radius must not wrap around here.
    let max = Cell { i: high.i.saturating_add(1), j: high.j.saturating_add(1) };
    CellBounds { min, max }.intersection(&grid.bounds())
}

/// Where a robot's centre may be: a snapshot of a grid.
#[derive(Clone, Debug)]
pub struct Traversable {
    resolution_m: f64,
    bounds: CellBounds,
    /// Cost of a metre in each cell, in 16ths; 0 is not passable.
    weights: Vec<u8>,
    /// Squared distance to the nearest obstacle cell, in cells, up to a reach.
    squared_clearance: Vec<u16>,
    regions: OnceLock<Regions>,
}

impl Traversable {
    /// A snapshot of all that the grid knows.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, config: &PlanConfig) -> Self {
        Self::in_region(grid, config, grid.bounds())
    }

    /// A snapshot of a part of the grid. `region` may reach beyond what the grid knows. Occupied
    /// cells outside the region are not seen, so let it be larger than the way by the robot's
    /// radius.
    #[must_use]
    pub fn in_region(grid: &OccupancyGrid, config: &PlanConfig, region: CellBounds) -> Self {
        let mut states = Vec::with_capacity(region.width() * region.height());
        for j in region.min.j..region.max.j {
            states.extend((region.min.i..region.max.i).map(|i| grid.state(Cell { i, j })));
        }
        Self::from_states(&states, region, grid.resolution_m(), config)
    }

    /// The same of states of cells, row by row.
    pub(crate) fn from_states(
        states: &[CellState],
        region: CellBounds,
        resolution_m: f64,
        config: &PlanConfig,
    ) -> Self {
        let cells = |metres: f64| (metres.max(0.0) / resolution_m).ceil() as usize;
        let reach_cells =
            cells(config.robot_radius_m.max(config.comfort_clearance_m)).clamp(1, clearance::MAX_REACH_CELLS);
        let obstacle: Vec<bool> = match config.unknown {
            UnknownCells::Obstacle => states.iter().map(|&state| state != CellState::Free).collect(),
            _ => states.iter().map(|&state| state == CellState::Occupied).collect(),
        };
        let squared_clearance = clearance::squared_clearance(&obstacle, region.width(), reach_cells);
        let weight_of = weights_by_squared_clearance(config, resolution_m, reach_cells);
        let weights = states
            .iter()
            .zip(&squared_clearance)
            .map(|(&state, &squared)| match state {
                CellState::Free => weight_of[usize::from(squared)],
                CellState::Unknown if config.unknown == UnknownCells::Allowed => weight_of[usize::from(squared)],
                _ => 0,
            })
            .collect();
        Self { resolution_m, bounds: region, weights, squared_clearance, regions: OnceLock::new() }
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// The cells of the snapshot.
    #[must_use]
    pub fn bounds(&self) -> CellBounds {
        self.bounds
    }

    /// The cell that contains `point`.
    #[must_use]
    pub fn cell_of(&self, point: Point2) -> Cell {
        let index = |metres: f64| (metres / self.resolution_m).floor() as i32;
        Cell { i: index(point.x), j: index(point.y) }
    }

    /// The centre of a cell, metres.
    #[must_use]
    pub fn centre(&self, cell: Cell) -> Point2 {
        let metres = |index: i32| (f64::from(index) + 0.5) * self.resolution_m;
        Point2::new(metres(cell.i), metres(cell.j))
    }

    /// Distance from the cell's centre to the nearest obstacle's, metres; exact up to the greater
    /// of robot radius and comfort clearance, and one cell more than that for everything farther.
    /// Zero outside the snapshot.
    #[must_use]
    pub fn clearance_m(&self, cell: Cell) -> f64 {
        let squared = self.bounds.index(cell).map_or(0, |index| self.squared_clearance[index]);
        f64::from(squared).sqrt() * self.resolution_m
    }

    /// Whether the robot's centre may be in this cell. False outside the snapshot.
    #[must_use]
    pub fn is_passable(&self, cell: Cell) -> bool {
        self.weight(cell) > 0
    }

    fn weight(&self, cell: Cell) -> u8 {
        self.bounds.index(cell).map_or(0, |index| self.weights[index])
    }

    fn is_obstacle(&self, cell: Cell) -> bool {
        self.bounds.index(cell).is_some_and(|index| self.squared_clearance[index] == 0)
    }

    /// The passable cell nearest to `point` within `reach_m` metres that no obstacle separates from
    /// it.
    #[must_use]
    pub fn nearest_passable(&self, point: Point2, reach_m: f64) -> Option<Cell> {
        if !(point.x.is_finite() && point.y.is_finite()) {
            return None;
        }
        let own = self.cell_of(point);
        if self.is_passable(own) {
            return Some(own);
        }
        let reach = (reach_m / self.resolution_m).ceil() as i32;
        let around = (-reach..=reach).flat_map(|dj| (-reach..=reach).map(move |di| (di, dj)));
        let mut candidates: Vec<(i32, Cell)> = around
            .filter(|(di, dj)| di * di + dj * dj <= reach * reach)
            .map(|(di, dj)| (di * di + dj * dj, Cell { i: own.i + di, j: own.j + dj }))
            .filter(|&(_, cell)| self.is_passable(cell))
            .collect();
        candidates.sort_unstable();
        let blocked = |cell: Cell| cell != own && self.is_obstacle(cell);
        let is_clear = |&cell: &Cell| all_cells_between(own, cell, |between| !blocked(between));
        candidates.into_iter().map(|(_, cell)| cell).find(is_clear)
    }
}

/// The weight of a free cell for every squared clearance.
fn weights_by_squared_clearance(config: &PlanConfig, resolution_m: f64, reach_cells: usize) -> Vec<u8> {
    let most = (reach_cells + 1) * (reach_cells + 1);
    let band = (config.comfort_clearance_m - config.robot_radius_m).max(f64::EPSILON);
    let weight = config.comfort_weight.clamp(0.0, 14.0);
    (0..=most)
        .map(|squared| {
            let clearance = (squared as f64).sqrt() * resolution_m;
            // Exactly the radius is too near, whichever way its decimals were rounded.
            if squared == 0 || clearance <= config.robot_radius_m + 1e-9 {
                return 0;
            }
            let nearness = ((config.comfort_clearance_m - clearance) / band).clamp(0.0, 1.0);
            (f64::from(UNIT_WEIGHT) * (1.0 + weight * nearness)).round() as u8
        })
        .collect()
}

#[cfg(test)]
mod tests;
