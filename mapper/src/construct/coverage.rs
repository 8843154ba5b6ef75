//! Support nodes for free space that no rectangle covers: paths lead through rectangles, and where
//! there is none they make a detour or none leads at all. Greedy: of all rectangles that could be
//! added, always the one that covers most.
//!
//! Two things are to be covered: where the centre of a robot may be that keeps the distance from
//! walls that paths keep; and the ground under a robot that squeezes into a gap too narrow for
//! that, for nobody else can tell the way out of it.

use super::plan_config;
use fht_map::MapState;
use fht_navigation::planning::Traversable;
use fht_perception::free_rectangle::{FreeRectangleConfig, grow};
use fht_perception::grid::{Cell, CellBounds, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::{FixedPoint, Footprint, Rect};
use serde::{Deserialize, Serialize};

/// Parameters of the coverage.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CoverageConfig {
    /// A rectangle covers what is farther than this from its border: where a robot of this radius
    /// may be, metres. Default 0.16.
    pub half_width_m: f64,
    /// The least that a new rectangle must cover, square metres. Default 0.06, which is what is
    /// left open in a doorway of 0.9 m: about 30 bytes of map each.
    pub least_gain_m2: f64,
    /// Edges of such a node at most: its rectangle joins it to others already. Default 2.
    pub most_edges: usize,
    /// Distance of the places that are tried, metres; half of it in gaps. Default 0.2.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.05, max = 100.0)))]
    pub spacing_m: f64,
    /// The robot's radius, metres. Default 0.105.
    pub robot_radius_m: f64,
    /// The least that a rectangle in a gap must cover of the ground under the robot, square metres.
    /// Default 0.08.
    pub least_ground_m2: f64,
}

impl Default for CoverageConfig {
    fn default() -> Self {
        Self {
            half_width_m: Footprint::default().mesh_clearance_m(),
            least_gain_m2: 0.06,
            most_edges: 2,
            spacing_m: 0.2,
            robot_radius_m: Footprint::default().circumscribed_radius_m(),
            least_ground_m2: 0.08,
        }
    }
}

impl CoverageConfig {
    /// Nothing is covered.
    #[must_use]
    pub fn none() -> Self {
        Self { least_gain_m2: f64::INFINITY, least_ground_m2: f64::INFINITY, ..Self::default() }
    }
}

/// A place for a support node, with its rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Where the node would be.
    pub place: FixedPoint,
    /// What it would cover.
    pub rect: Rect,
}

impl Patch {
    /// Places in the rectangle where its node could be instead, the nearest first: centres of every
    /// second cell, the same cells for all patches.
    #[must_use]
    pub fn places(&self, grid: &OccupancyGrid) -> Vec<FixedPoint> {
        let (min, max) = (self.rect.min(self.place), self.rect.max(self.place));
        let (low, high) = (grid.cell_of(Point2::new(min.0, min.1)), grid.cell_of(Point2::new(max.0, max.1)));
        let every_second = |low: i32, high: i32| (low..=high).filter(|index| index % 2 == 0);
        let cells = every_second(low.j, high.j).flat_map(|j| every_second(low.i, high.i).map(move |i| Cell { i, j }));
        let centres = cells.map(|cell| grid.centre(cell));
        let inside = centres.filter(|at| (min.0..=max.0).contains(&at.x) && (min.1..=max.1).contains(&at.y));
        let places = inside.map(|at| FixedPoint::from_metres(at.x, at.y));
        let mut places: Vec<FixedPoint> = std::iter::once(self.place).chain(places).collect();
        places.sort_by(|a, b| a.distance(self.place).total_cmp(&b.distance(self.place)).then(a.cmp(b)));
        places
    }

    /// The same rectangle around a node elsewhere in it.
    #[must_use]
    pub fn seen_from(&self, place: FixedPoint) -> Self {
        Self { place, rect: Rect::around(place, self.rect.min(self.place), self.rect.max(self.place)) }
    }
}

/// What is to be covered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoverageGoal {
    /// Where the centre of a robot may be, at the distance from walls that paths keep.
    Centre,
    /// The ground under a robot wherever it fits.
    Ground,
}

/// What is to be covered, and which of it no rectangle covers yet.
pub struct Gaps {
    /// A rectangle covers what is farther than this from its border, metres.
    margin_m: f64,
    least_cells: f64,
    every: i32,
    bounds: CellBounds,
    resolution_m: f64,
    open: Vec<bool>,
    patches: Vec<Patch>,
}

impl Gaps {
    /// The gaps of a map in a grid, among the places that can be reached from its nodes.
    #[must_use]
    pub fn of(
        map: &MapState,
        grid: &OccupancyGrid,
        free_space: &FreeRectangleConfig,
        config: &CoverageConfig,
        goal: CoverageGoal,
    ) -> Self {
        let resolution_m = grid.resolution_m();
        let (clearance_m, margin_m, least_m2, spacing_m) = match goal {
            CoverageGoal::Centre => (config.half_width_m, config.half_width_m, config.least_gain_m2, config.spacing_m),
            CoverageGoal::Ground => (config.robot_radius_m, 0.0, config.least_ground_m2, 0.5 * config.spacing_m),
        };
        let space = Traversable::new(grid, &plan_config(clearance_m, grid));
        let mut open = reachable(map, grid, &space);
        if goal == CoverageGoal::Ground {
            open = widened(&open, grid, config.robot_radius_m);
        }
        let mut gaps = Self {
            margin_m,
            least_cells: least_m2 / resolution_m.powi(2),
            every: (spacing_m / resolution_m).round().max(1.0) as i32,
            bounds: grid.bounds(),
            resolution_m,
            open,
            patches: Vec::new(),
        };
        for node in map.nodes() {
            if let Some(rect) = node.free_space {
                gaps.cover(&Patch { place: node.pose.position, rect });
            }
        }
        gaps.patches = gaps.candidates(grid, free_space);
        gaps
    }

    fn candidates(&self, grid: &OccupancyGrid, free_space: &FreeRectangleConfig) -> Vec<Patch> {
        let on_lattice = |cell: &Cell| cell.i.rem_euclid(self.every) == 0 && cell.j.rem_euclid(self.every) == 0;
        let cells = (0..self.open.len()).filter(|&index| self.open[index]).map(|index| self.bounds.cell(index));
        let patch = |cell: Cell| {
            let centre = grid.centre(cell);
            let place = FixedPoint::from_metres(centre.x, centre.y);
            Some(Patch { place, rect: grow(grid, place, free_space)? })
        };
        cells.filter(on_lattice).filter_map(patch).collect()
    }

    /// The patch that covers most of what is open, if that is enough; it is taken out.
    pub fn take_best(&mut self) -> Option<Patch> {
        let sums = self.sums();
        let gain = |patch: &Patch| self.covered(patch).map_or(0, |(low, high)| count(&sums, &self.bounds, low, high));
        let (index, most) =
            self.patches.iter().map(gain).enumerate().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)))?;
        (f64::from(most) >= self.least_cells).then(|| self.patches.swap_remove(index))
    }

    /// What a patch covers is no gap any more.
    pub fn cover(&mut self, patch: &Patch) {
        let Some((low, high)) = self.covered(patch) else { return };
        for j in low.j..=high.j {
            for i in low.i..=high.i {
                if let Some(index) = self.bounds.index(Cell { i, j }) {
                    self.open[index] = false;
                }
            }
        }
    }

    /// The cells whose centres a patch covers: least and greatest, both included; `None` if there
    /// is none.
    fn covered(&self, patch: &Patch) -> Option<(Cell, Cell)> {
        let (min, max) = (patch.rect.min(patch.place), patch.rect.max(patch.place));
        let margin = self.margin_m;
        let first = |metres: f64| ((metres + margin) / self.resolution_m - 0.5).ceil() as i32;
        let last = |metres: f64| ((metres - margin) / self.resolution_m - 0.5).floor() as i32;
        let low = Cell { i: first(min.0).max(self.bounds.min.i), j: first(min.1).max(self.bounds.min.j) };
        let high = Cell { i: last(max.0).min(self.bounds.max.i - 1), j: last(max.1).min(self.bounds.max.j - 1) };
        (low.i <= high.i && low.j <= high.j).then_some((low, high))
    }

    /// How many open cells lie below and left of each corner of the cells.
    fn sums(&self) -> Vec<u32> {
        let (width, height) = (self.bounds.width(), self.bounds.height());
        let mut sums = vec![0_u32; (width + 1) * (height + 1)];
        for row in 0..height {
            let mut sum = 0;
            for column in 0..width {
                sum += u32::from(self.open[row * width + column]);
                sums[(row + 1) * (width + 1) + column + 1] = sums[row * (width + 1) + column + 1] + sum;
            }
        }
        sums
    }
}

/// The cells where a robot may be that can be reached from the nodes.
fn reachable(map: &MapState, grid: &OccupancyGrid, space: &Traversable) -> Vec<bool> {
    let bounds = grid.bounds();
    let mut open = vec![false; bounds.width() * bounds.height()];
    let mut waiting: Vec<Cell> = map.nodes().map(|node| grid.cell_of(super::point(node.pose.position))).collect();
    while let Some(cell) = waiting.pop() {
        if let Some(index) = bounds.index(cell)
            && !open[index]
            && space.is_passable(cell)
        {
            open[index] = true;
            waiting.extend([(1, 0), (0, 1), (-1, 0), (0, -1)].map(|(i, j)| Cell { i: cell.i + i, j: cell.j + j }));
        }
    }
    open
}

/// The free cells within `radius_m` of cells that are open.
fn widened(open: &[bool], grid: &OccupancyGrid, radius_m: f64) -> Vec<bool> {
    let bounds = grid.bounds();
    let reach = (radius_m / grid.resolution_m()).floor() as i32;
    let disc = (-reach..=reach).flat_map(|dj| (-reach..=reach).map(move |di| (di, dj)));
    let disc: Vec<(i32, i32)> = disc.filter(|(di, dj)| di * di + dj * dj <= reach * reach).collect();
    let is_under = |index: usize| {
        let cell = bounds.cell(index);
        grid.is_surely_free(cell)
            && disc.iter().any(|(di, dj)| {
                let beside = Cell { i: cell.i + di, j: cell.j + dj };
                bounds.index(beside).is_some_and(|index| open[index])
            })
    };
    (0..open.len()).map(is_under).collect()
}

/// Open cells from `low` to `high`, both included.
fn count(sums: &[u32], bounds: &CellBounds, low: Cell, high: Cell) -> u32 {
    let stride = bounds.width() + 1;
    let at = |i: i32, j: i32| sums[(j - bounds.min.j) as usize * stride + (i - bounds.min.i) as usize];
    at(high.i + 1, high.j + 1) + at(low.i, low.j) - at(low.i, high.j + 1) - at(high.i + 1, low.j)
}
