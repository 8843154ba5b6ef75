//! Shortest ways over the grid for a robot with a width.
//!
//! A [`Traversable`] is a snapshot of an [`OccupancyGrid`]: which cells the robot's centre may be in, how far each is
//! from the nearest obstacle, and what a metre costs there. It does not borrow the grid, so a planning thread can own it.

mod clearance;
mod search;

use crate::grid::{Cell, CellBounds, CellState, OccupancyGrid};
use crate::pose::Point2;
use search::{CostField, Extent, STRAIGHT, UNIT_WEIGHT};

/// What the planner takes unknown cells for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnknownCells {
    /// Not passable, but the robot may pass beside them (exploration: frontiers are beside unknown cells).
    Forbidden,
    /// Not passable, and kept at the robot's radius like walls.
    Obstacle,
    /// As passable as free cells (a client with an empty grid of its own).
    Allowed,
}

/// How the grid becomes passable cells and costs.
#[derive(Clone, Debug)]
pub struct PlanConfig {
    /// The robot's centre keeps more than this from the centre of every occupied cell, metres. Default 0.15: the
    /// robot's 0.105 m and most of a cell.
    pub robot_radius_m: f64,
    /// Nearer to occupied cells than this, a metre costs more, metres. Default 0.35.
    pub comfort_clearance_m: f64,
    /// How much more a metre costs at `robot_radius_m`, falling linearly to nothing at `comfort_clearance_m`: 2 makes it
    /// cost three metres. At most 14. Default 2. At 0 the cheapest path is the shortest.
    pub comfort_weight: f64,
    /// What unknown cells are. Default forbidden.
    pub unknown: UnknownCells,
}

impl Default for PlanConfig {
    fn default() -> Self {
        Self { robot_radius_m: 0.15, comfort_clearance_m: 0.35, comfort_weight: 2.0, unknown: UnknownCells::Forbidden }
    }
}

impl PlanConfig {
    /// Plain lengths without the comfort cost: what the paper's refinement compares with (section III-D).
    #[must_use]
    pub fn shortest() -> Self {
        Self { comfort_weight: 0.0, ..Self::default() }
    }
}

/// A path over the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridPath {
    /// From start to goal, in the grid's frame, metres. Never empty.
    pub points: Vec<Point2>,
    /// Length of `points`, metres.
    pub length_m: f64,
}

/// Length of a line of points, metres.
#[must_use]
pub fn path_length_m(points: &[Point2]) -> f64 {
    points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
}

/// The cells within `radius_m` of `centre` along each axis, as far as the grid knows any: a path from `centre` that is no
/// longer stays in it.
#[must_use]
pub fn region_around(grid: &OccupancyGrid, centre: Point2, radius_m: f64) -> CellBounds {
    let reach = nalgebra::Vector2::repeat(radius_m.max(0.0));
    let (low, high) = (grid.cell_of(centre - reach), grid.cell_of(centre + reach));
    let known = grid.bounds();
    let min = Cell { i: low.i.max(known.min.i), j: low.j.max(known.min.j) };
    // Casts saturate: an infinite radius must not wrap around here.
    let max = Cell { i: high.i.saturating_add(1).min(known.max.i), j: high.j.saturating_add(1).min(known.max.j) };
    CellBounds { min, max: Cell { i: max.i.max(min.i), j: max.j.max(min.j) } }
}

/// How far a robot that stands too near to a wall looks for a passable cell, metres.
const ESCAPE_REACH_M: f64 = 0.6;

/// Where a robot's centre may be: a snapshot of a grid.
#[derive(Clone, Debug)]
pub struct Traversable {
    resolution_m: f64,
    bounds: CellBounds,
    /// Cost of a metre in each cell, in 16ths; 0 is not passable.
    weights: Vec<u8>,
    /// Squared distance to the nearest obstacle cell, in cells, up to a reach.
    squared_clearance: Vec<u16>,
}

impl Traversable {
    /// A snapshot of all that the grid knows.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, config: &PlanConfig) -> Self {
        Self::in_region(grid, config, grid.bounds())
    }

    /// A snapshot of a part of the grid. `region` may reach beyond what the grid knows. Occupied cells outside the
    /// region are not seen, so let it be larger than the way by the robot's radius.
    #[must_use]
    pub fn in_region(grid: &OccupancyGrid, config: &PlanConfig, region: CellBounds) -> Self {
        let mut states = Vec::with_capacity(region.width() * region.height());
        for j in region.min.j..region.max.j {
            states.extend((region.min.i..region.max.i).map(|i| grid.state(Cell { i, j })));
        }
        Self::from_states(&states, region, grid.resolution_m(), config)
    }

    fn from_states(states: &[CellState], region: CellBounds, resolution_m: f64, config: &PlanConfig) -> Self {
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
        Self { resolution_m, bounds: region, weights, squared_clearance }
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

    /// Distance from the cell's centre to the nearest obstacle's, metres; exact up to the greater of robot radius and
    /// comfort clearance, and one cell more than that for everything farther. Zero outside the snapshot.
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

    /// The passable cell nearest to `point` within `reach_m` metres that no obstacle separates from it.
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

    /// Cheapest ways from `start` to everywhere that can be reached (Dijkstra over the passable cells).
    #[must_use]
    pub fn distances_from(&self, start: Point2) -> DistanceField<'_> {
        self.distances_within(start, f64::INFINITY)
    }

    /// As [`distances_from`](Self::distances_from), but only as far as `limit_m` metres (comfort cost included).
    #[must_use]
    pub fn distances_within(&self, start: Point2, limit_m: f64) -> DistanceField<'_> {
        // A cast from a float saturates, so no limit is the greatest limit.
        let limit = (limit_m.max(0.0) / self.resolution_m * f64::from(STRAIGHT)) as u32;
        let from = self.nearest_passable(start, ESCAPE_REACH_M);
        let costs = from.map(|cell| search::search(&self.bounds, &self.weights, cell, Extent::Cost(limit)));
        DistanceField { space: self, start, costs }
    }

    /// The cheapest path (the shortest, without comfort cost) over eight-connected passable cells: A*, exact. A robot
    /// that stands too near to a wall first leaves by the nearest passable cell. `None` if there is no way or `to` is
    /// not in a passable cell.
    #[must_use]
    pub fn shortest_path(&self, from: Point2, to: Point2) -> Option<GridPath> {
        let target = self.cell_of(to);
        if !self.is_passable(target) {
            return None;
        }
        let start = self.nearest_passable(from, ESCAPE_REACH_M)?;
        let costs = search::search(&self.bounds, &self.weights, start, Extent::Target(target));
        costs.cost(self.bounds.index(target)?)?;
        let points = self.points(from, &costs, target, Some(to));
        Some(GridPath { length_m: path_length_m(&points), points })
    }

    /// The exact start, the centres of the cells on the way, and the exact goal.
    fn points(&self, from: Point2, costs: &CostField, end: Cell, to: Option<Point2>) -> Vec<Point2> {
        let cells = search::trace(&self.bounds, &self.weights, costs, end);
        let leaves_start_cell = cells.first().is_some_and(|&first| first != self.cell_of(from));
        let skipped_at_start = usize::from(!leaves_start_cell);
        let skipped_at_end = usize::from(to.is_some());
        let last = cells.len().saturating_sub(skipped_at_end).max(skipped_at_start);
        let centres = cells.get(skipped_at_start..last).unwrap_or_default().iter().map(|&cell| self.centre(cell));
        std::iter::once(from).chain(centres).chain(to).collect()
    }

    /// Whether the robot can drive straight from `a` to `b`: every cell that the segment touches is passable.
    #[must_use]
    pub fn is_segment_passable(&self, a: Point2, b: Point2) -> bool {
        self.segment_cost(a, b).is_some()
    }

    /// Weighted length of a segment over passable cells, metres.
    fn segment_cost(&self, a: Point2, b: Point2) -> Option<f64> {
        let length = (b - a).norm();
        let (mut sum, mut count, mut open) = (0_u32, 0_u32, true);
        let visit = |cell: Cell| {
            let weight = self.weight(cell);
            open &= weight > 0;
            sum += u32::from(weight);
            count += 1;
            open
        };
        for_each_touched_cell(a / self.resolution_m, b / self.resolution_m, visit);
        open.then(|| length * f64::from(sum) / f64::from(count.max(1) * u32::from(UNIT_WEIGHT)))
    }

    /// Pulls a path straight: leaves out the points between two that a straight drive joins at no greater cost, the
    /// robot's width and the comfort cost included. Segments that are not passable (the way out of a wall) stay.
    #[must_use]
    pub fn shorten(&self, path: &[Point2]) -> Vec<Point2> {
        let Some(&first) = path.first() else { return Vec::new() };
        let mut short = vec![first];
        let mut anchor = 0;
        while anchor + 1 < path.len() {
            let mut best = anchor + 1;
            let mut along = self.segment_cost(path[anchor], path[best]).unwrap_or(f64::INFINITY);
            for next in anchor + 2..path.len() {
                along += self.segment_cost(path[next - 1], path[next]).unwrap_or(f64::INFINITY);
                let Some(direct) = self.segment_cost(path[anchor], path[next]) else { break };
                // Cell weights along a segment are averages of what it touches: allow for that.
                if direct <= along * 1.02 {
                    best = next;
                }
            }
            short.push(path[best]);
            anchor = best;
        }
        short
    }
}

/// Cheapest ways from one place to everywhere.
pub struct DistanceField<'a> {
    space: &'a Traversable,
    start: Point2,
    costs: Option<CostField>,
}

impl DistanceField<'_> {
    /// Length of the cheapest way to a cell, metres, with the comfort cost in it (plain length if the comfort weight is
    /// zero). `None` where the robot cannot get.
    #[must_use]
    pub fn distance_m(&self, cell: Cell) -> Option<f64> {
        let cost = self.costs.as_ref()?.cost(self.space.bounds.index(cell)?)?;
        Some(f64::from(cost) / f64::from(STRAIGHT) * self.space.resolution_m)
    }

    /// The cheapest way to a cell: the start, then the centres of the cells. Empty where the robot cannot get.
    #[must_use]
    pub fn path_to(&self, cell: Cell) -> Vec<Point2> {
        match &self.costs {
            Some(costs) if self.distance_m(cell).is_some() => self.space.points(self.start, costs, cell, None),
            _ => Vec::new(),
        }
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

/// Visits every cell that a segment touches, in units of cells, in order, until `visit` says no. Through a corner
/// between four cells it visits them all.
fn for_each_touched_cell(a: Point2, b: Point2, mut visit: impl FnMut(Cell) -> bool) {
    let floor = |value: f64| value.floor() as i32;
    let mut cell = Cell { i: floor(a.x), j: floor(a.y) };
    let end = Cell { i: floor(b.x), j: floor(b.y) };
    let along = b - a;
    // Parameter of the next crossing of a grid line, and between crossings, per axis.
    let axis = |from: f64, delta: f64| {
        let next = if delta > 0.0 { from.floor() + 1.0 } else { from.floor() };
        if delta == 0.0 { (f64::INFINITY, f64::INFINITY) } else { ((next - from) / delta, 1.0 / delta.abs()) }
    };
    let ((mut t_x, step_x), (mut t_y, step_y)) = (axis(a.x, along.x), axis(a.y, along.y));
    // Steps always go towards the end, so that rounding cannot make it miss the end and run on.
    while cell != end {
        if !visit(cell) {
            return;
        }
        let (left_x, left_y) = ((end.i - cell.i).signum(), (end.j - cell.j).signum());
        if left_x != 0 && left_y != 0 && (t_x - t_y).abs() < 1e-9 {
            if !visit(Cell { i: cell.i + left_x, j: cell.j }) || !visit(Cell { i: cell.i, j: cell.j + left_y }) {
                return;
            }
            cell = Cell { i: cell.i + left_x, j: cell.j + left_y };
            t_x += step_x;
            t_y += step_y;
        } else if left_y == 0 || (left_x != 0 && t_x < t_y) {
            cell.i += left_x;
            t_x += step_x;
        } else {
            cell.j += left_y;
            t_y += step_y;
        }
    }
    visit(end);
}

/// Whether `accept` holds for all cells on the line from centre to centre.
fn all_cells_between(a: Cell, b: Cell, mut accept: impl FnMut(Cell) -> bool) -> bool {
    let centre = |cell: Cell| Point2::new(f64::from(cell.i) + 0.5, f64::from(cell.j) + 0.5);
    let mut all = true;
    for_each_touched_cell(centre(a), centre(b), |cell| {
        all &= accept(cell);
        all
    });
    all
}

#[cfg(test)]
mod tests;
