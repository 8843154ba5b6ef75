//! Seams: where what this robot has seen ends, and another one has seen on. Nobody looks there again; but if both only looked
//! into a passage from its ends, no node joins them, and the map leads the long way round. Such a passage has to be driven.

use crate::construct::point;
use crate::refine::{RefineConfig, Roadmap};
use fht_proto::NodeId;
use fht_robot::grid::OccupancyGrid;
use fht_robot::planning::{PlanConfig, Traversable, region_around};
use fht_robot::pose::Point2;

/// The map beside what is known to be free.
pub(super) struct Seams<'a> {
    /// The nodes and edges of all explorers.
    pub(super) roadmap: &'a Roadmap,
    /// What is free, as this robot and the others have seen it.
    pub(super) free: &'a OccupancyGrid,
    /// The planner's idea of the robot.
    pub(super) plan: &'a PlanConfig,
    /// Which ways over the map are too long.
    pub(super) config: &'a RefineConfig,
}

impl Seams<'_> {
    /// Whether the way through a place between two nodes around it is much shorter than the map's: by the measure of the map's
    /// refinement.
    pub(super) fn is_missing_link(&self, place: Point2) -> bool {
        let radius_m = self.config.radius_m;
        let plan = PlanConfig { comfort_weight: 0.0, ..self.plan.clone() };
        let space = Traversable::in_region(self.free, &plan, region_around(self.free, place, radius_m));
        let field = space.distances_within(place, radius_m);
        let way_m = |at: Point2| field.distance_m(space.cell_of(at)).filter(|way_m| *way_m <= radius_m);
        let near = self.roadmap.nodes().map(|(id, position)| (id, point(position)));
        let near = near.filter(|(_, at)| (at - place).norm() <= radius_m);
        let near: Vec<(NodeId, f64)> = near.filter_map(|(id, at)| Some((id, way_m(at)?))).collect();
        let Some((nearest, to_it_m)) = near.iter().min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0))) else {
            return false;
        };
        let on_map = self.roadmap.distances_from(*nearest);
        near.iter().any(|(id, from_it_m)| {
            let free_m = to_it_m + from_it_m;
            let map_m = on_map.get(id).copied().unwrap_or(f64::INFINITY);
            map_m > self.config.ratio * free_m && map_m - free_m > self.config.saving_m
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{AuthorId, EdgeKey, FixedPoint};
    use fht_robot::grid::{Cell, CellBounds, CellState, GridConfig};

    /// Two corridors side by side, joined at their left ends, and the right ends by a passage.
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
        let id = |number: u32| NodeId { author: AuthorId(number % 2 + 1), number };
        let mut roadmap = Roadmap::default();
        for ((x, y), number) in places.into_iter().zip(0..) {
            roadmap.add_node(id(number), FixedPoint::from_metres(x, y));
        }
        (0..5).for_each(|number| roadmap.add_edge(EdgeKey::new(id(number), id(number + 1))));
        let (plan, config) = (PlanConfig::default(), RefineConfig::default());
        let is_missing = |roadmap: &Roadmap, at: Point2| {
            Seams { roadmap, free: &free, plan: &plan, config: &config }.is_missing_link(at)
        };
        assert!(is_missing(&roadmap, Point2::new(9.2, 2.5)));
        assert!(!is_missing(&Roadmap::default(), Point2::new(9.2, 2.5)));
        roadmap.add_edge(EdgeKey::new(id(0), id(5)));
        assert!(!is_missing(&roadmap, Point2::new(9.2, 2.5)));
    }
}
