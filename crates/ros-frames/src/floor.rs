//! What is known of a floor as `nav_msgs/OccupancyGrid`.

use crate::plane::header_message;
use fht_perception::evidence_grid::EvidenceGrid;
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_ros_messages::msg::{MapMetaData, OccupancyGridMsg, Pose, Vector3};

/// Cells row by row, from the one of least x and y, in the frame `map`.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorGrid {
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// The corner of least x and y, metres.
    pub origin: Point2,
    /// Cells along x.
    pub width: usize,
    /// What is known of each cell.
    pub cells: Vec<CellState>,
}

impl From<&OccupancyGrid> for FloorGrid {
    fn from(grid: &OccupancyGrid) -> Self {
        let bounds = grid.bounds();
        let cells = (bounds.min.j..bounds.max.j).flat_map(|j| (bounds.min.i..bounds.max.i).map(move |i| Cell { i, j }));
        let metres = |index: i32| f64::from(index) * grid.resolution_m();
        Self {
            resolution_m: grid.resolution_m(),
            origin: Point2::new(metres(bounds.min.i), metres(bounds.min.j)),
            width: bounds.width(),
            cells: cells.map(|cell| grid.state(cell)).collect(),
        }
    }
}

impl From<&EvidenceGrid> for FloorGrid {
    fn from(grid: &EvidenceGrid) -> Self {
        let (origin, width) = (grid.origin(), grid.width());
        Self { resolution_m: grid.resolution_m(), origin, width, cells: grid.states().collect() }
    }
}

/// The floor at `time_us`, in the frame `map`.
#[must_use]
pub fn grid_message(time_us: u64, grid: &FloorGrid) -> OccupancyGridMsg {
    let value = |state: &CellState| match state {
        CellState::Free => 0,
        CellState::Occupied => 100,
        CellState::Unknown => -1,
    };
    let header = header_message(time_us, "map");
    OccupancyGridMsg {
        info: MapMetaData {
            map_load_time: header.stamp,
            resolution: grid.resolution_m as f32,
            width: grid.width as u32,
            height: (grid.cells.len() / grid.width.max(1)) as u32,
            origin: Pose { position: Vector3 { x: grid.origin.x, y: grid.origin.y, z: 0.0 }, ..Pose::default() },
        },
        header,
        data: grid.cells.iter().map(value).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::evidence_grid::Sighting;
    use fht_perception::grid::{CellBounds, GridConfig};

    #[test]
    fn both_kinds_of_grid_lie_where_they_are() {
        let bounds = CellBounds { min: Cell { i: -2, j: 4 }, max: Cell { i: 1, j: 6 } };
        let states = [CellState::Free, CellState::Occupied, CellState::Unknown].repeat(2);
        let grid = OccupancyGrid::from_states(GridConfig::default(), bounds, states);
        let message = grid_message(7, &FloorGrid::from(&grid));
        assert_eq!((message.info.width, message.info.height, message.data), (3, 2, vec![0, 100, -1, 0, 100, -1]));
        assert!(
            (message.info.origin.position.x + 0.1).abs() < 1e-9 && (message.info.origin.position.y - 0.2).abs() < 1e-9
        );

        let end = Point2::new(2.0, 1.0);
        let grid = EvidenceGrid::new(&[Sighting { from: Point2::origin(), ends: vec![end] }], &[]);
        let floor = FloorGrid::from(&grid);
        let state_at = |place: Point2| {
            let cell = (place - floor.origin) / floor.resolution_m;
            floor.cells[cell.y as usize * floor.width + cell.x as usize]
        };
        assert_eq!((state_at(end), state_at(Point2::new(1.0, 0.5))), (CellState::Occupied, CellState::Free));
        assert_eq!(state_at(Point2::new(0.2, 0.9)), CellState::Unknown);
        assert_eq!(floor.cells.len() % floor.width, 0);
    }
}
