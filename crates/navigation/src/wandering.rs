//! Where to go while the robot does not know where it is: the paper's "random movements", as a walk
//! towards what the robot has not seen yet, so that it soon passes main nodes.

use crate::planning::{PlanConfig, Traversable, UnknownCells};
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use fht_perception::square::{SquareIndex, square_of};
use fht_proto::Footprint;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How the next place is chosen.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct WanderingConfig {
    /// Way to the next place that is liked best, metres. Default 3 (paper).
    pub liked_way_m: f64,
    /// Weight of going on ahead over turning. Default 2 (the paper's).
    pub ahead_weight: f64,
    /// Taken off for every earlier visit of the place. Default 0.7.
    pub visit_penalty: f64,
    /// Fewest frontier cells in half a metre for a frontier. Default 6.
    pub min_frontier_cells: usize,
    /// How the robot plans its way there.
    pub plan: PlanConfig,
}

impl Default for WanderingConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

impl WanderingConfig {
    /// For a robot of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            liked_way_m: 3.0,
            ahead_weight: 2.0,
            visit_penalty: 0.7,
            min_frontier_cells: 6,
            plan: PlanConfig { unknown: UnknownCells::Forbidden, ..PlanConfig::of(footprint) },
        }
    }
}

/// Side of the squares in which visits are counted, metres.
const VISIT_CELL_M: f64 = 1.5;
/// Side of the squares in which frontier cells are gathered, metres.
const FRONTIER_CELL_M: f64 = 0.5;

/// Chooses places to wander to.
pub struct Wanderer {
    config: WanderingConfig,
    visits: BTreeMap<SquareIndex, u32>,
    last_square: Option<SquareIndex>,
}

impl Wanderer {
    /// Has been nowhere.
    #[must_use]
    pub fn new(config: WanderingConfig) -> Self {
        Self { config, visits: BTreeMap::new(), last_square: None }
    }

    /// Remembers that the robot is here (odometry frame).
    pub fn visit(&mut self, here: Point2) {
        let square = square_of(here, VISIT_CELL_M);
        if self.last_square != Some(square) {
            *self.visits.entry(square).or_default() += 1;
            self.last_square = Some(square);
        }
    }

    /// Marks a place as not worth another try.
    pub fn give_up(&mut self, place: Point2) {
        *self.visits.entry(square_of(place, VISIT_CELL_M)).or_default() += 3;
    }

    /// The next place and the way to it (odometry frame): the best frontier, or somewhere at random
    /// if none can be reached. `None` if the robot cannot move at all.
    pub fn next(&self, grid: &OccupancyGrid, odom_from_base: &Pose2, rng: &mut impl Rng) -> Option<Vec<Point2>> {
        let space = Traversable::new(grid, &self.config.plan);
        let here = Point2::from(odom_from_base.translation.vector);
        let field = space.distances_from(here);
        let bounds = space.bounds();
        let mut frontiers: BTreeMap<SquareIndex, Vec<(f64, Cell)>> = BTreeMap::new();
        let mut reachable: Vec<(f64, Cell)> = Vec::new();
        for index in 0..bounds.width() * bounds.height() {
            let cell = bounds.cell(index);
            if !space.is_passable(cell) {
                continue;
            }
            let Some(way_m) = field.distance_m(cell) else { continue };
            if way_m < 0.6 {
                continue;
            }
            if is_beside_unknown(grid, cell) {
                let square = square_of(space.centre(cell), FRONTIER_CELL_M);
                frontiers.entry(square).or_default().push((way_m, cell));
            } else if cell.i % 8 == 0 && cell.j % 8 == 0 {
                reachable.push((way_m, cell));
            }
        }
        let heading = odom_from_base.rotation.angle();
        let value = |way_m: f64, cell: Cell| {
            let towards = space.centre(cell) - here;
            let turn = wrap_angle(towards.y.atan2(towards.x) - heading);
            let visits = self.visits.get(&square_of(space.centre(cell), VISIT_CELL_M)).copied().unwrap_or(0);
            (-(way_m - self.config.liked_way_m).powi(2) / 8.0).exp() + self.config.ahead_weight * (-turn * turn).exp()
                - self.config.visit_penalty * f64::from(visits)
                - 0.02 * way_m
        };
        let best_frontier = frontiers
            .values()
            .filter(|cells| cells.len() >= self.config.min_frontier_cells)
            .filter_map(|cells| cells.iter().min_by(|a, b| a.0.total_cmp(&b.0)))
            .map(|&(way_m, cell)| (value(way_m, cell), cell))
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let goal = match best_frontier {
            Some((_, cell)) => cell,
            None => {
                // All is seen: somewhere at random, rather where the robot was seldom.
                let tries = (0..8).filter_map(|_| {
                    let &(way_m, cell) = reachable.get(rng.random_range(0..reachable.len().max(1)))?;
                    Some((value(way_m, cell), cell))
                });
                tries.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)))?.1
            }
        };
        Some(space.shorten(&field.path_to(goal))).filter(|path| path.len() >= 2)
    }
}

fn is_beside_unknown(grid: &OccupancyGrid, cell: Cell) -> bool {
    let around = (-1..=1).flat_map(|dj| (-1..=1).map(move |di| Cell { i: cell.i + di, j: cell.j + dj }));
    around.into_iter().any(|near| grid.state(near) == CellState::Unknown)
}
