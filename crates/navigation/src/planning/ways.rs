//! The cheapest ways from a place: to one other, or to everywhere.

use super::Traversable;
use super::regions::Regions;
use super::search::{self, CostField, Extent, STRAIGHT};
use fht_perception::grid::Cell;
use fht_perception::pose::Point2;
use std::collections::BTreeSet;

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

/// How far a robot that stands too near to a wall looks for a passable cell, metres.
pub const ESCAPE_REACH_M: f64 = 0.6;

impl Traversable {
    /// Cheapest ways from `start` to everywhere that can be reached (Dijkstra over the passable
    /// cells).
    #[must_use]
    pub fn distances_from(&self, start: Point2) -> DistanceField<'_> {
        self.distances_within(start, f64::INFINITY)
    }

    /// As [`distances_from`](Self::distances_from), but only as far as `limit_m` metres (comfort
    /// cost included).
    #[must_use]
    pub fn distances_within(&self, start: Point2, limit_m: f64) -> DistanceField<'_> {
        // A cast from a float saturates, so no limit is the greatest limit.
        let limit = (limit_m.max(0.0) / self.resolution_m * f64::from(STRAIGHT)) as u32;
        let from = self.nearest_passable(start, ESCAPE_REACH_M);
        let costs = from.map(|cell| search::search(&self.bounds, &self.weights, cell, Extent::Cost(limit)));
        DistanceField { space: self, start, costs }
    }

    /// The cheapest path (the shortest, without comfort cost) over eight-connected passable cells:
    /// A*, exact. A robot that stands too near to a wall first leaves by the nearest passable cell.
    /// `None` if there is no way or `to` is not in a passable cell.
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

    /// All cells are sorted into regions when one is first asked for.
    fn regions(&self) -> &Regions {
        self.regions.get_or_init(|| Regions::of(&self.bounds, &self.weights))
    }

    /// The region of a cell where a robot may be.
    fn region_of(&self, cell: Cell) -> Option<u32> {
        self.bounds.index(cell).and_then(|index| self.regions().region(index))
    }

    /// Whether some way leads from a place to a cell, however long: whether
    /// [`distances_from`](Self::distances_from) gets there.
    #[must_use]
    pub fn has_way(&self, from: Point2, to: Cell) -> bool {
        let start = self.nearest_passable(from, ESCAPE_REACH_M).and_then(|cell| self.region_of(cell));
        start.is_some() && start == self.region_of(to)
    }

    /// Of each cell, in the order of the snapshot's bounds, whether a way joins it with one of
    /// `cells`.
    #[must_use]
    pub fn joined_with(&self, cells: impl Iterator<Item = Cell>) -> Vec<bool> {
        let joined: BTreeSet<u32> = cells.filter_map(|cell| self.region_of(cell)).collect();
        self.regions().all().iter().map(|region| joined.contains(region)).collect()
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
}

/// Cheapest ways from one place to everywhere.
pub struct DistanceField<'a> {
    space: &'a Traversable,
    start: Point2,
    costs: Option<CostField>,
}

impl DistanceField<'_> {
    /// Length of the cheapest way to a cell, metres, with the comfort cost in it (plain length if
    /// the comfort weight is zero). `None` where the robot cannot get.
    #[must_use]
    pub fn distance_m(&self, cell: Cell) -> Option<f64> {
        let cost = self.costs.as_ref()?.cost(self.space.bounds.index(cell)?)?;
        Some(f64::from(cost) / f64::from(STRAIGHT) * self.space.resolution_m)
    }

    /// The cheapest way to a cell: the start, then the centres of the cells. Empty where the robot
    /// cannot get.
    #[must_use]
    pub fn path_to(&self, cell: Cell) -> Vec<Point2> {
        match &self.costs {
            Some(costs) if self.distance_m(cell).is_some() => self.space.points(self.start, costs, cell, None),
            _ => Vec::new(),
        }
    }
}
