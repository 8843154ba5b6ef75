//! The true floor of a simulated building, for maps to be drawn on.

use fht_perception::grid::CellState;
use fht_perception::pose::{Point2, Pose2};
use fht_picture::{Extent, Floor};
use fht_sim::FloorPlan;

/// A true floor plan in the frame of a map.
pub struct TrueFloor<'a> {
    plan: &'a FloorPlan,
    world_from_map: Pose2,
}

impl<'a> TrueFloor<'a> {
    /// `plan` is in the world's frame; `world_from_map` says where the map's frame truly lies.
    #[must_use]
    pub fn new(plan: &'a FloorPlan, world_from_map: Pose2) -> Self {
        Self { plan, world_from_map }
    }
}

impl Floor for TrueFloor<'_> {
    /// Around the free floor: beyond it everything is a wall.
    fn extent(&self) -> Option<Extent> {
        let map_from_world = self.world_from_map.inverse();
        let (plan, width) = (self.plan, self.plan.width());
        let free = plan.cells().iter().enumerate().filter(|(_, is_occupied)| !**is_occupied);
        Extent::around(free.map(|(index, _)| map_from_world * plan.centre_of(index % width, index / width)))
    }

    fn state_at(&self, place: Point2) -> CellState {
        let place = self.world_from_map * place;
        match self.plan.cell_of(place) {
            None => CellState::Unknown,
            Some(_) if self.plan.is_occupied(place.x, place.y) => CellState::Occupied,
            Some(_) => CellState::Free,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_turned_map_lies_on_its_floor() {
        // 3 × 1 m of floor, the last metre a wall. The map begins in its middle, looking along y.
        let cells = (0..30).map(|index| index >= 20).collect();
        let plan = FloorPlan::new(0.1, Point2::new(5.0, 5.0), 30, 1, cells);
        let floor = TrueFloor::new(&plan, pose(6.0, 5.05, FRAC_PI_2));
        let extent = floor.extent().unwrap();
        assert!((extent.min - Point2::new(0.0, -0.95)).norm() < 1e-9, "{extent:?}");
        assert!((extent.max - Point2::new(0.0, 0.95)).norm() < 1e-9, "{extent:?}");
        let states = [(0.0, 0.5), (0.0, -1.5), (0.5, 0.0)].map(|(x, y)| floor.state_at(Point2::new(x, y)));
        assert_eq!(states, [CellState::Free, CellState::Occupied, CellState::Unknown]);
    }
}
