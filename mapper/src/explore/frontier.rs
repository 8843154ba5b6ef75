//! Frontiers: where known free space ends and unknown space begins (paper section III-A).

use crate::explore::SeenSquares;
use fht_navigation::planning::{DistanceField, Traversable};
use fht_perception::grid::{Cell, CellBounds, CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::Square;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::sync::Arc;

/// What counts as a frontier worth driving to.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct FrontierConfig {
    /// Smaller clusters are gaps between beams, not ways on; cells. Default 20, 1 m of edge:
    /// through a door that the robot fits through, it sees a wedge of floor with longer edges than
    /// that.
    pub min_cells: usize,
    /// But so few are enough where the robot could go on: the gap between a bed and a wall, say, of
    /// which the cells beside either are no frontier. Default 4.
    pub gap_cells: usize,
    /// The robot could go on over unknown cells with nothing occupied nearer than this, metres.
    /// Default 0.1.
    pub gap_room_m: f64,
    /// A gap is looked into on the way only, from at most this far: buildings have many, and a tour
    /// of them at the end would be longer than all the rest. Metres. Default 8.
    pub gap_reach_m: f64,
    /// Frontiers with less unknown space behind them are gaps as well, square metres: unknown cells
    /// that hang together with the frontier's. Default 0.3. A closed door's slit passes, the shadow
    /// of a table's leg does not.
    pub min_unknown_m2: f64,
    /// Frontier cells at most this far apart, in cells along each axis, are one cluster. Default 2.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 100)))]
    pub join_cells: i32,
    /// A cluster's size is counted in squares of this side, so that a ragged edge counts no more
    /// than a smooth one, metres. Default 0.3 (paper's thinning of frontiers).
    #[cfg_attr(feature = "schema", schemars(range(min = 0.01, max = 10.0)))]
    pub thinning_m: f64,
    /// A frontier too near to walls for the robot may be looked at from a cell this near to it,
    /// metres. Default 1.
    pub vantage_reach_m: f64,
}

impl Default for FrontierConfig {
    fn default() -> Self {
        Self {
            min_cells: 20,
            gap_cells: 4,
            gap_room_m: 0.1,
            gap_reach_m: 8.0,
            min_unknown_m2: 0.3,
            join_cells: 2,
            thinning_m: 0.3,
            vantage_reach_m: 1.0,
        }
    }
}

impl FrontierConfig {
    /// No gap is looked into.
    #[must_use]
    pub fn without_gaps() -> Self {
        Self { gap_cells: usize::MAX, ..Self::default() }
    }
}

/// A cluster of frontier cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frontier {
    /// Its cells, sorted.
    pub cells: Vec<Cell>,
    /// Number of squares of the configured thinning that it touches.
    pub size: usize,
    /// Whether it is a gap, of fewer cells than other frontiers.
    pub is_gap: bool,
}

impl Frontier {
    /// Of cells of a grid with cells of `resolution_m` metres, counted in squares of `thinning_m`.
    pub(super) fn of(mut cells: Vec<Cell>, resolution_m: f64, thinning_m: f64, is_gap: bool) -> Self {
        cells.sort_unstable();
        let per_square = (thinning_m / resolution_m).round().max(1.0) as i32;
        let square = |cell: &Cell| (cell.i.div_euclid(per_square), cell.j.div_euclid(per_square));
        let size = cells.iter().map(square).collect::<BTreeSet<_>>().len();
        Self { cells, size, is_gap }
    }
}

/// From where a frontier is best looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// The cell to drive to.
    pub stand: Cell,
    /// The frontier cell to see from there.
    pub target: Cell,
    /// Length of the way there, with the planner's comfort cost, metres.
    pub distance_m: f64,
}

/// What a robot knows of a building: its grid, and what others say that they have seen.
#[derive(Clone, Copy)]
pub struct Knowledge<'a> {
    /// The robot's grid.
    pub grid: &'a OccupancyGrid,
    /// What others have seen.
    pub others: &'a [Arc<SeenSquares>],
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sight {
    Free,
    Occupied,
    Unknown,
}

impl<'a> Knowledge<'a> {
    /// That of a robot that is alone.
    #[must_use]
    pub fn alone(grid: &'a OccupancyGrid) -> Self {
        Self { grid, others: &[] }
    }

    /// What others say of a cell: it is free if one says so and nobody else that something stands
    /// there.
    fn hearsay(&self, cell: Cell) -> Sight {
        let mut sight = Sight::Unknown;
        for seen in self.others {
            match seen.square(cell) {
                Square::Occupied => return Sight::Occupied,
                Square::Free => sight = Sight::Free,
                Square::Unseen => {}
            }
        }
        sight
    }

    /// Whether this robot has seen a cell for a moment only, and nobody else that it is free.
    pub(super) fn is_half_seen(&self, cell: Cell) -> bool {
        self.grid.is_barely_free(cell) && self.hearsay(cell) != Sight::Free
    }

    fn sight(&self, cell: Cell) -> Sight {
        match self.grid.state(cell) {
            CellState::Free => Sight::Free,
            CellState::Occupied => Sight::Occupied,
            CellState::Unknown => self.hearsay(cell),
        }
    }
}

/// Whether a cell is free, has an unknown cell among its eight neighbours, and no occupied one.
#[must_use]
pub fn is_frontier(known: &Knowledge<'_>, cell: Cell) -> bool {
    let neighbours = (-1..=1).flat_map(|dj| (-1..=1).map(move |di| Cell { i: cell.i + di, j: cell.j + dj }));
    known.sight(cell) == Sight::Free && {
        let mut unknown = false;
        for sight in neighbours.map(|cell| known.sight(cell)) {
            match sight {
                Sight::Occupied => return false,
                Sight::Unknown => unknown = true,
                Sight::Free => {}
            }
        }
        unknown
    }
}

/// Number of frontier cells whose centre is within `radius_m` of a point.
#[must_use]
pub fn frontier_cells_near(known: &Knowledge<'_>, point: Point2, radius_m: f64) -> usize {
    cells_near(known.grid, point, radius_m).filter(|cell| is_frontier(known, *cell)).count()
}

/// The cells whose centre is within `radius_m` of a point.
pub(super) fn cells_near(grid: &OccupancyGrid, point: Point2, radius_m: f64) -> impl Iterator<Item = Cell> {
    let centre = grid.cell_of(point);
    let reach = (radius_m / grid.resolution_m()).ceil() as i32;
    let around = (-reach..=reach).flat_map(move |dj| (-reach..=reach).map(move |di| (di, dj)));
    around
        .map(move |(di, dj)| Cell { i: centre.i + di, j: centre.j + dj })
        .filter(move |&cell| (grid.centre(cell) - point).norm() <= radius_m)
}

/// All frontiers in a region of the grid that are large enough there, in the order of their first
/// cells.
#[must_use]
pub fn find_frontiers(known: &Knowledge<'_>, bounds: CellBounds, config: &FrontierConfig) -> Vec<Frontier> {
    let grid = known.grid;
    let mut waiting = frontier_mask(known, &bounds);
    let least_unknown = (config.min_unknown_m2 / grid.resolution_m().powi(2)).ceil() as usize;
    let gap_room = (config.gap_room_m / grid.resolution_m()).round() as i32;
    let mut frontiers = Vec::new();
    for first in 0..waiting.len() {
        if !waiting[first] {
            continue;
        }
        let cells = take_cluster(&mut waiting, &bounds, bounds.cell(first), config.join_cells);
        let is_gap = cells.len() < config.min_cells;
        let room = if is_gap { gap_room } else { 0 };
        if (is_gap && cells.len() < config.gap_cells) || !opens_on(known, &cells, least_unknown, room) {
            continue;
        }
        frontiers.push(Frontier::of(cells, grid.resolution_m(), config.thinning_m, is_gap));
    }
    frontiers
}

/// Which cells are frontier cells, row by row.
fn frontier_mask(known: &Knowledge<'_>, bounds: &CellBounds) -> Vec<bool> {
    let width = bounds.width();
    let mut mask = Vec::with_capacity(width * bounds.height());
    // With one cell more on either side, for the neighbours.
    let row_of =
        |j: i32| -> Vec<Sight> { (bounds.min.i - 1..=bounds.max.i).map(|i| known.sight(Cell { i, j })).collect() };
    let (mut below, mut here) = (row_of(bounds.min.j - 1), row_of(bounds.min.j));
    // What the columns of three cells hold: unknown, occupied.
    let mut columns = vec![(false, false); width + 2];
    for j in bounds.min.j..bounds.max.j {
        let above = row_of(j + 1);
        for (((column, &below), &here), &above) in columns.iter_mut().zip(&below).zip(&here).zip(&above) {
            let holds = |sight: Sight| below == sight || here == sight || above == sight;
            *column = (holds(Sight::Unknown), holds(Sight::Occupied));
        }
        mask.extend(columns.windows(3).zip(&here[1..]).map(|(around, &sight)| {
            sight == Sight::Free && around.iter().any(|column| column.0) && !around.iter().any(|column| column.1)
        }));
        below = std::mem::replace(&mut here, above);
    }
    mask
}

/// Takes the cells that hang together with `first` out of `waiting`.
pub(super) fn take_cluster(waiting: &mut [bool], bounds: &CellBounds, first: Cell, join: i32) -> Vec<Cell> {
    let mut take = |cell: Cell| bounds.index(cell).is_some_and(|index| std::mem::take(&mut waiting[index]));
    let mut cells = Vec::new();
    if take(first) {
        cells.push(first);
    }
    let mut next = 0;
    while let Some(&cell) = cells.get(next) {
        next += 1;
        for dj in -join..=join {
            for di in -join..=join {
                let beside = Cell { i: cell.i + di, j: cell.j + dj };
                if take(beside) {
                    cells.push(beside);
                }
            }
        }
    }
    cells
}

/// Whether at least `count` unknown cells with nothing occupied within `room` cells hang together
/// with each other and with some of `cells`.
fn opens_on(known: &Knowledge<'_>, cells: &[Cell], count: usize, room: i32) -> bool {
    let grid = known.grid;
    let has_room = |at: Cell| {
        let mut around =
            (-room..=room).flat_map(|dj| (-room..=room).map(move |di| Cell { i: at.i + di, j: at.j + dj }));
        room == 0 || around.all(|cell| grid.state(cell) != CellState::Occupied)
    };
    let beside = |cell: Cell| [(1, 0), (0, 1), (-1, 0), (0, -1)].map(|(i, j)| Cell { i: cell.i + i, j: cell.j + j });
    let mut seen = BTreeSet::new();
    // Several separate slits are not one room: each is counted for itself.
    for &cell in cells {
        let mut waiting: Vec<Cell> = vec![cell];
        let mut area = 0;
        while let Some(next) = waiting.pop() {
            for cell in beside(next) {
                if known.sight(cell) == Sight::Unknown && seen.insert(cell) && has_room(cell) {
                    area += 1;
                    waiting.push(cell);
                }
            }
            if area >= count {
                return true;
            }
        }
    }
    count == 0
}

impl Approach {
    /// To see `target` from `stand`, if that can be reached.
    fn by(distances: &DistanceField<'_>, stand: Cell, target: Cell) -> Option<Self> {
        distances.distance_m(stand).map(|distance_m| Self { stand, target, distance_m })
    }
}

/// The cheapest way to one of a frontier's own cells that `is_open` accepts.
pub(super) fn own_approach(
    frontier: &Frontier,
    distances: &DistanceField<'_>,
    is_open: impl Fn(Cell) -> bool,
) -> Option<Approach> {
    let cheaper = |a: &Approach, b: &Approach| a.distance_m.total_cmp(&b.distance_m).then(a.stand.cmp(&b.stand));
    let open = frontier.cells.iter().copied().filter(|&cell| is_open(cell));
    open.filter_map(|cell| Approach::by(distances, cell, cell)).min_by(cheaper)
}

/// The cheapest way to see a frontier: to one of its own cells, or, if the robot fits into none of
/// them, to a cell near one of them with nothing in between. Only frontier cells that `is_open`
/// accepts are looked at. `None` if there is no such cell that can be reached.
#[must_use]
pub fn approach(
    frontier: &Frontier,
    grid: &OccupancyGrid,
    space: &Traversable,
    distances: &DistanceField<'_>,
    config: &FrontierConfig,
    is_open: impl Fn(Cell) -> bool,
) -> Option<Approach> {
    if let Some(own) = own_approach(frontier, distances, &is_open) {
        return Some(own);
    }
    let at = |stand: Cell, target: Cell| Approach::by(distances, stand, target);
    let open: Vec<Cell> = frontier.cells.iter().copied().filter(|&cell| is_open(cell)).collect();
    // A few targets suffice: the cluster's cells lie next to each other.
    let reach = (config.vantage_reach_m / space.resolution_m()).floor() as i32;
    let every = (open.len() / 8).max(1);
    let targets = open.iter().copied().step_by(every);
    let near = |target: Cell| {
        let around = (-reach..=reach).flat_map(move |dj| (-reach..=reach).map(move |di| (di, dj)));
        around
            .filter(move |(di, dj)| di * di + dj * dj <= reach * reach)
            .map(move |(di, dj)| (Cell { i: target.i + di, j: target.j + dj }, target))
    };
    let mut vantages: Vec<Approach> = targets.flat_map(near).filter_map(|(stand, target)| at(stand, target)).collect();
    // Among those that can be reached, the nearest to the frontier see it best.
    let sight = |vantage: &Approach| (space.centre(vantage.stand) - space.centre(vantage.target)).norm();
    vantages.sort_by(|a, b| sight(a).total_cmp(&sight(b)).then(a.stand.cmp(&b.stand)).then(a.target.cmp(&b.target)));
    let in_sight = |vantage: &Approach| {
        grid.is_corridor_unoccupied(space.centre(vantage.stand), space.centre(vantage.target), 0.0)
    };
    vantages.into_iter().find(in_sight)
}

#[cfg(test)]
mod tests;
