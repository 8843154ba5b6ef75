//! Seams: where what this robot has seen ends, and another one has seen on. Nobody looks there
//! again; but if both only looked into a passage from its ends, the map knows no way through, and
//! leads the long way round. Such a passage has to be driven.

use crate::construct::{RefinementConfig, point};
use fht_map::plan::shortest_path;
use fht_map::{FreeSpace, MapState, NodeRouteConfig, PathEnds, SpaceConfig};
use fht_navigation::planning::{PlanConfig, Traversable, UnknownCells, region_around};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::Point2;
use fht_proto::FixedPoint;

/// The map beside what is known to be free.
pub(super) struct MissingLinks<'a> {
    /// The map of all explorers.
    map: &'a MapState,
    /// Where it knows ways.
    space: FreeSpace,
    /// What is free, as this robot and the others have seen it.
    free: &'a OccupancyGrid,
    /// The planner's idea of the robot.
    plan: &'a PlanConfig,
    /// Which ways over the map are too long.
    config: &'a RefinementConfig,
}

impl<'a> MissingLinks<'a> {
    pub(super) fn of(
        map: &'a MapState,
        free: &'a OccupancyGrid,
        plan: &'a PlanConfig,
        config: &'a RefinementConfig,
    ) -> Self {
        Self { map, space: FreeSpace::of(map, &SpaceConfig::default()), free, plan, config }
    }

    /// Whether the way through a place between two nodes around it is much shorter than the map's.
    pub(super) fn is_missing_link(&self, place: Point2) -> bool {
        let radius_m = self.config.radius_m;
        let plan = PlanConfig { comfort_weight: 0.0, unknown: UnknownCells::Obstacle, ..self.plan.clone() };
        let ways = Traversable::in_region(self.free, &plan, region_around(self.free, place, radius_m));
        let field = ways.distances_within(place, radius_m);
        let way_m = |at: Point2| field.distance_m(ways.cell_of(at)).filter(|way_m| *way_m <= radius_m);
        // No way leads to some nodes yet, wherever one comes from.
        let joined = self.map.nodes().filter(|node| self.map.neighbours(node.id).next().is_some());
        let near = joined.map(|node| node.pose.position);
        let near = near.filter(|at| (point(*at) - place).norm() <= radius_m);
        let near: Vec<(FixedPoint, f64)> = near.filter_map(|at| Some((at, way_m(point(at))?))).collect();
        let Some((nearest, to_it_m)) = near.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return false };
        near.iter().any(|(there, from_it_m)| {
            let free_m = to_it_m + from_it_m;
            let is_long = |map_m: f64| map_m > self.config.ratio * free_m && map_m - free_m > self.config.saving_m;
            let config = NodeRouteConfig { ends: PathEnds::Known, ..NodeRouteConfig::default() };
            match shortest_path::plan(self.map, &self.space, *nearest, *there, &config) {
                Ok(route) => is_long(route.length_m),
                Err(_) => is_long(f64::INFINITY),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::grid::{Cell, CellBounds, CellState, GridConfig};
    use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, NodeId, NodeKind, Op};

    /// Two corridors, joined at their left ends, and the right ends by a passage.
    fn loop_of_corridors() -> OccupancyGrid {
        let bounds = CellBounds { min: Cell { i: 0, j: 0 }, max: Cell { i: 200, j: 100 } };
        let state = |cell: Cell| match cell {
            Cell { i: 0 | 199, .. } | Cell { j: 0 | 99, .. } => CellState::Occupied,
            Cell { i: 30..=169, j: 30..=69 } => CellState::Occupied,
            _ => CellState::Free,
        };
        let cells = bounds.width() * bounds.height();
        OccupancyGrid::from_states(GridConfig::default(), bounds, (0..cells).map(|index| state(bounds.cell(index))))
    }

    #[test]
    fn a_passage_that_the_map_goes_round_is_a_missing_link() {
        let free = loop_of_corridors();
        let places = [(9.2, 1.0), (5.0, 0.8), (0.8, 0.8), (0.8, 4.2), (5.0, 4.2), (9.2, 4.0)];
        let author = AuthorId(1);
        let id = |number: u32| NodeId { author, number };
        let node = |(number, (x, y)): (u32, (f64, f64))| Op::PutNode {
            id: id(number),
            kind: NodeKind::Support,
            pose: FixedPose { position: FixedPoint::from_metres(x, y), yaw_e4: 0 },
        };
        let edge = |a: u32, b: u32| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) };
        let mut ops: Vec<Op> = (0..).zip(places).map(node).collect();
        ops.extend((0..5).map(|number| edge(number, number + 1)));
        let map = |ops: &[Op]| {
            let mut map = MapState::new();
            map.apply(&Increment { author, number: 1, hlc_us: 1, ops: ops.to_vec() });
            map
        };
        let (plan, config) = (PlanConfig::default(), RefinementConfig::default());
        let is_missing = |map: &MapState, at: Point2| MissingLinks::of(map, &free, &plan, &config).is_missing_link(at);
        assert!(is_missing(&map(&ops), Point2::new(9.2, 2.5)));
        assert!(!is_missing(&MapState::new(), Point2::new(9.2, 2.5)));
        ops.push(edge(0, 5));
        assert!(!is_missing(&map(&ops), Point2::new(9.2, 2.5)));
    }
}
