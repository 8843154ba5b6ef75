//! What is known of a floor as `nav_msgs/OccupancyGrid`.

use crate::plane::header_message;
use fht_perception::evidence_grid::EvidenceGrid;
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_ros_messages::msg::{MapMetaData, OccupancyGridMsg, OccupancyGridUpdate, Pose, Vector3};

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

impl FloorGrid {
    /// Whether both have the same cells in the same places, whatever is known of them.
    #[must_use]
    pub fn has_cells_of(&self, other: &Self) -> bool {
        (self.resolution_m, self.origin, self.width, self.cells.len())
            == (other.resolution_m, other.origin, other.width, other.cells.len())
    }
}

fn value(state: CellState) -> i8 {
    match state {
        CellState::Free => 0,
        CellState::Occupied => 100,
        CellState::Unknown => -1,
    }
}

/// What has changed from `before` to `now`, a grid of the same cells, at `time_us`: the least
/// rectangle that holds all of it. `None` if nothing has.
#[must_use]
pub fn update_message(time_us: u64, before: &FloorGrid, now: &FloorGrid) -> Option<OccupancyGridUpdate> {
    let width = now.width.max(1);
    let changed = before.cells.iter().zip(&now.cells).enumerate().filter(|(_, (old, new))| old != new);
    let bounds = changed.fold(None, |bounds: Option<[usize; 4]>, (index, _)| {
        let (x, y) = (index % width, index / width);
        let [left, low, right, high] = bounds.unwrap_or([x, y, x, y]);
        Some([left.min(x), low.min(y), right.max(x), high.max(y)])
    });
    let [left, low, right, high] = bounds?;
    let rows = now.cells.chunks(width).skip(low).take(high - low + 1);
    Some(OccupancyGridUpdate {
        header: header_message(time_us, "map"),
        x: i32::try_from(left).unwrap_or(i32::MAX),
        y: i32::try_from(low).unwrap_or(i32::MAX),
        width: (right - left + 1) as u32,
        height: (high - low + 1) as u32,
        data: rows.flat_map(|row| row.iter().skip(left).take(right - left + 1)).copied().map(value).collect(),
    })
}

/// The floor at `time_us`, in the frame `map`.
#[must_use]
pub fn grid_message(time_us: u64, grid: &FloorGrid) -> OccupancyGridMsg {
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
        data: grid.cells.iter().copied().map(value).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::evidence_grid::Sighting;
    use fht_perception::grid::{CellBounds, GridConfig};
    use proptest::prelude::*;

    fn state() -> impl Strategy<Value = CellState> {
        prop::sample::select(vec![CellState::Free, CellState::Occupied, CellState::Unknown])
    }

    proptest! {
        #[test]
        fn a_grid_and_its_updates_are_the_next_grid(
            width in 1..9_usize,
            cells in prop::collection::vec(state(), 72),
            changes in prop::collection::vec((0..72_usize, state()), 0..5),
        ) {
            let count = 72 / width * width;
            let before =
                FloorGrid { resolution_m: 0.05, origin: Point2::origin(), width, cells: cells[..count].to_vec() };
            let mut now = before.clone();
            for (index, state) in changes {
                now.cells[index % count] = state;
            }
            prop_assert!(now.has_cells_of(&before));
            let mut message = grid_message(1, &before);
            let update = update_message(2, &before, &now);
            prop_assert_eq!(update.is_none(), before == now);
            if let Some(update) = update {
                prop_assert_eq!(update.data.len(), (update.width * update.height) as usize);
                for (index, value) in update.data.iter().enumerate() {
                    let (column, row) = (index % update.width as usize, index / update.width as usize);
                    let at = (update.y as usize + row) * width + update.x as usize + column;
                    message.data[at] = *value;
                }
            }
            prop_assert_eq!(message.data, grid_message(2, &now).data);
        }
    }

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
