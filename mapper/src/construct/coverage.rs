//! Support nodes for free space that no rectangle covers: paths lead through rectangles, and where
//! there is none they make a detour or none leads at all. Greedy: of all rectangles that could be
//! added, always the one that covers most.
//!
//! Two things are to be covered: where the centre of a robot may be that keeps the distance from
//! walls that paths keep; and the ground under a robot that squeezes into a gap too narrow for
//! that, for nobody else can tell the way out of it.

use super::{plan_config, point};
use fht_map::MapState;
use fht_navigation::planning::Traversable;
use fht_perception::free_rectangle::{FreeRectangleConfig, grow};
use fht_perception::grid::{Cell, CellBounds, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::{FixedPoint, Footprint, Rect};
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

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
    candidates: Candidates,
}

/// A patch that could be added.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    patch: Patch,
    /// Open cells that it covered when they were last counted. There are never more of them later.
    at_most: u32,
}

/// The patches that could be added, and an order of them. A large building has a million.
#[derive(Default)]
struct Candidates {
    all: Vec<Candidate>,
    /// What each covered at most, and its index: the most first, of equals the first. Of what is
    /// not so any more, there are entries, too.
    order: BinaryHeap<(u32, Reverse<usize>)>,
}

impl Candidates {
    fn new(all: Vec<Candidate>) -> Self {
        let order = all.iter().enumerate().map(|(index, candidate)| (candidate.at_most, Reverse(index))).collect();
        Self { all, order }
    }

    /// The one that covered most when it was last counted.
    fn first(&mut self) -> Option<usize> {
        while let Some(&(at_most, Reverse(index))) = self.order.peek() {
            if self.all.get(index).is_some_and(|candidate| candidate.at_most == at_most) {
                return Some(index);
            }
            self.order.pop();
        }
        None
    }

    /// It covers so many cells now.
    fn count(&mut self, index: usize, at_most: u32) {
        self.all[index].at_most = at_most;
        self.order.push((at_most, Reverse(index)));
    }

    /// Takes one out; the last one has its index then.
    fn take(&mut self, index: usize) -> Patch {
        let taken = self.all.swap_remove(index);
        if let Some(moved) = self.all.get(index) {
            self.order.push((moved.at_most, Reverse(index)));
        }
        taken.patch
    }
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
        // Where a robot may be that can be reached from the nodes.
        let mut open = space.joined_with(map.nodes().map(|node| grid.cell_of(point(node.pose.position))));
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
            candidates: Candidates::default(),
        };
        for node in map.nodes() {
            if let Some(rect) = node.free_space {
                gaps.cover(&Patch { place: node.pose.position, rect });
            }
        }
        gaps.candidates = Candidates::new(gaps.all_candidates(grid, free_space));
        gaps
    }

    fn all_candidates(&self, grid: &OccupancyGrid, free_space: &FreeRectangleConfig) -> Vec<Candidate> {
        let on_lattice = |cell: &Cell| cell.i.rem_euclid(self.every) == 0 && cell.j.rem_euclid(self.every) == 0;
        let cells = (0..self.open.len()).filter(|&index| self.open[index]).map(|index| self.bounds.cell(index));
        let patch = |cell: Cell| {
            let centre = grid.centre(cell);
            let place = FixedPoint::from_metres(centre.x, centre.y);
            let patch = Patch { place, rect: grow(grid, place, free_space)? };
            Some(Candidate { patch, at_most: self.gain(&patch) })
        };
        cells.filter(on_lattice).filter_map(patch).collect()
    }

    /// The patch that covers most of what is open, if that is enough; it is taken out. Of equals
    /// the first.
    ///
    /// What a patch covers only becomes less, so only those are counted again that were ahead of
    /// all others when they were counted last (Minoux, "Accelerated greedy algorithms for
    /// maximizing submodular set functions", 1978).
    pub fn take_best(&mut self) -> Option<Patch> {
        loop {
            let index = self.candidates.first()?;
            let Candidate { patch, at_most } = self.candidates.all[index];
            if f64::from(at_most) < self.least_cells {
                return None;
            }
            let gain = self.gain(&patch);
            if gain == at_most {
                return Some(self.candidates.take(index));
            }
            self.candidates.count(index, gain);
        }
    }

    /// How many open cells a patch covers.
    fn gain(&self, patch: &Patch) -> u32 {
        let Some((low, high)) = self.covered(patch) else { return 0 };
        let row = |j: i32| {
            let ends = [low, high].map(|end| self.bounds.index(Cell { i: end.i, j }));
            let [Some(first), Some(last)] = ends else { return 0 };
            self.open[first..=last].iter().map(|is_open| u32::from(*is_open)).sum()
        };
        (low.j..=high.j).map(row).sum()
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIDE: i32 = 30;
    const RESOLUTION_M: f64 = 0.1;

    /// Gaps all over, and rectangles of which one corner and the size are given in cells.
    fn gaps(rects: &[(i32, i32, i32, i32)]) -> Gaps {
        let bounds = CellBounds { min: Cell { i: 0, j: 0 }, max: Cell { i: SIDE, j: SIDE } };
        let open = vec![true; (SIDE * SIDE) as usize];
        let mut gaps = Gaps {
            margin_m: 0.0,
            least_cells: 4.0,
            every: 1,
            bounds,
            resolution_m: RESOLUTION_M,
            open,
            candidates: Candidates::default(),
        };
        let mut all = Vec::new();
        for (x, y, width, height) in rects {
            let metres = |cells: i32| f64::from(cells) * RESOLUTION_M;
            let (min, max) = ((metres(*x), metres(*y)), (metres(x + width), metres(y + height)));
            let place = FixedPoint::from_metres(min.0, min.1);
            let patch = Patch { place, rect: Rect::around(place, min, max) };
            let at_most = gaps.gain(&patch);
            all.push(Candidate { patch, at_most });
        }
        gaps.candidates = Candidates::new(all);
        gaps
    }

    /// The same with all of them counted again.
    fn counted_best(gaps: &mut Gaps) -> Option<Patch> {
        let gains: Vec<u32> = gaps.candidates.all.iter().map(|candidate| gaps.gain(&candidate.patch)).collect();
        let (index, gain) = gains.into_iter().enumerate().max_by(|a, b| a.1.cmp(&b.1).then(b.0.cmp(&a.0)))?;
        (f64::from(gain) >= gaps.least_cells).then(|| gaps.candidates.take(index))
    }

    proptest! {
        #[test]
        fn what_is_taken_is_what_counting_all_again_takes(
            rects in proptest::collection::vec((0..SIDE, 0..SIDE, 1..12, 1..12), 1..60),
            left_out in 0..5_usize,
        ) {
            let [mut lazy, mut plain] = [gaps(&rects), gaps(&rects)];
            for turn in 0.. {
                let (taken, best) = (lazy.take_best(), counted_best(&mut plain));
                prop_assert_eq!(taken, best);
                let Some(patch) = taken else { break };
                // Nobody gets to some of them.
                if turn % 5 != left_out {
                    lazy.cover(&patch);
                    plain.cover(&patch);
                }
            }
        }
    }
}
