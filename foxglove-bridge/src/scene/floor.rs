//! The map as a grid: what its rectangles and its main nodes' scans say of each cell, as robots
//! weigh their poses by.

use crate::scene::shapes::{MAP_FRAME, plane_pose};
use fht_localization::landmarks::Landmarks;
use fht_map::MapState;
use fht_perception::grid::CellState;
use foxglove::messages::{Grid, PackedElementField, Timestamp, Vector2, packed_element_field};

/// So many cells at most: 100 m by 100 m at 0.1 m. Of a larger map several become one.
const MAX_CELLS: usize = 1_000_000;
/// Bytes of a cell: red, green, blue, alpha.
const CELL_BYTES: u32 = 4;

/// Cells row by row, from the one of least x and y.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct FloorDrawing {
    cell_m: f64,
    origin: (f64, f64),
    columns: usize,
    cells: Vec<CellState>,
}

/// White, dark, or nothing: a viewer shows this as it is.
fn colour(state: CellState) -> [u8; CELL_BYTES as usize] {
    match state {
        CellState::Free => [255, 255, 255, 160],
        CellState::Occupied => [20, 20, 20, 255],
        CellState::Unknown => [0; 4],
    }
}

/// A wall in one of several cells counts, and then free ground.
fn together(a: CellState, b: CellState) -> CellState {
    match (a, b) {
        (CellState::Occupied, _) | (_, CellState::Occupied) => CellState::Occupied,
        (CellState::Free, _) | (_, CellState::Free) => CellState::Free,
        _ => CellState::Unknown,
    }
}

impl FloorDrawing {
    /// What is known of a map's floor. `landmarks` are those of the last time.
    pub(crate) fn of(map: &MapState, landmarks: &mut Landmarks) -> Self {
        landmarks.refresh(map);
        let known = &landmarks.walls().known;
        let (origin, columns) = (known.origin(), known.width());
        let cells = known.states().collect();
        Self { cell_m: known.resolution_m(), origin: (origin.x, origin.y), columns, cells }.at_most(MAX_CELLS)
    }

    fn rows(&self) -> usize {
        self.cells.len() / self.columns.max(1)
    }

    /// The same with `most` cells or fewer.
    fn at_most(self, most: usize) -> Self {
        let side = (1..).find(|side| self.columns.div_ceil(*side) * self.rows().div_ceil(*side) <= most.max(1));
        let side = side.unwrap_or(1);
        if side == 1 {
            return self;
        }
        let columns = self.columns.div_ceil(side);
        let mut cells = vec![CellState::Unknown; columns * self.rows().div_ceil(side)];
        for (index, cell) in self.cells.iter().enumerate() {
            let (column, row) = (index % self.columns / side, index / self.columns / side);
            let coarse = &mut cells[row * columns + column];
            *coarse = together(*coarse, *cell);
        }
        Self { cell_m: self.cell_m * side as f64, columns, cells, ..self }
    }
}

/// The floor as a message.
pub(crate) fn floor_grid(floor: FloorDrawing, at: Timestamp) -> Grid {
    let (x, y) = floor.origin;
    let columns = u32::try_from(floor.columns).unwrap_or(u32::MAX);
    let field = |(offset, name): (u32, &str)| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: packed_element_field::NumericType::Uint8.into(),
    };
    Grid {
        timestamp: Some(at),
        frame_id: MAP_FRAME.to_owned(),
        // Below what is drawn of the map.
        pose: Some(plane_pose([x, y, 0.0], -0.02)),
        column_count: columns,
        cell_size: Some(Vector2 { x: floor.cell_m, y: floor.cell_m }),
        row_stride: columns.saturating_mul(CELL_BYTES),
        cell_stride: CELL_BYTES,
        fields: (0..).zip(["red", "green", "blue", "alpha"]).map(field).collect(),
        data: floor.cells.into_iter().flat_map(colour).collect::<Vec<u8>>().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_cells_become_one_and_walls_stay() {
        let rows = ["..  .", ".. ..", "..#.."];
        let state = |letter: char| match letter {
            '.' => CellState::Free,
            '#' => CellState::Occupied,
            _ => CellState::Unknown,
        };
        let cells = rows.iter().flat_map(|row| row.chars()).map(state).collect();
        let floor = FloorDrawing { cell_m: 0.1, origin: (1.0, 2.0), columns: 5, cells };
        let coarse = floor.at_most(6);
        assert_eq!((coarse.cell_m, coarse.columns), (0.2, 3));
        assert_eq!(coarse.cells, ["...", ".#."].concat().chars().map(state).collect::<Vec<_>>());
        let grid = floor_grid(coarse, Timestamp::new(7, 0));
        assert_eq!((grid.row_stride, &grid.data[16..20]), (12, &[20, 20, 20, 255][..]));
        assert_eq!(FloorDrawing::default().at_most(6), FloorDrawing::default());
    }

    #[test]
    fn a_map_of_nothing_is_a_grid_of_nothing() {
        let floor = FloorDrawing::of(&MapState::new(), &mut Landmarks::default());
        let grid = floor_grid(floor, Timestamp::new(7, 0));
        assert_eq!((grid.column_count, grid.data.len()), (0, 0));
    }
}
