//! The explorer's occupancy grid as it is stored and counted: the known part, a byte a cell,
//! deflated.

use fht_perception::grid::{Cell, CellBounds, CellState, GridConfig, OccupancyGrid};
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};

/// A grid map.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GridMap {
    resolution_m: f64,
    /// Least cell along x and y.
    min: [i32; 2],
    width: u32,
    height: u32,
    deflated: Vec<u8>,
}

/// Bytes of cells, as in pictures of maps (`map_server`): free, occupied, unknown.
const BYTES: [u8; 3] = [254, 0, 205];
/// Most cells along an axis.
const MOST_CELLS: u32 = 40_000;

fn byte_of(state: CellState) -> u8 {
    match state {
        CellState::Free => BYTES[0],
        CellState::Occupied => BYTES[1],
        CellState::Unknown => BYTES[2],
    }
}

fn state_of(byte: u8) -> CellState {
    match byte {
        254 => CellState::Free,
        0 => CellState::Occupied,
        _ => CellState::Unknown,
    }
}

impl GridMap {
    /// The known part of a grid.
    ///
    /// # Errors
    /// When it cannot be deflated.
    pub fn of(grid: &OccupancyGrid) -> io::Result<Self> {
        let bounds = grid.bounds();
        let all = (0..bounds.width() * bounds.height()).map(|index| bounds.cell(index));
        let known = all.filter(|&cell| grid.state(cell) != CellState::Unknown);
        let extent = known.fold(None, |extent: Option<[Cell; 2]>, cell| {
            let [low, high] = extent.unwrap_or([cell; 2]);
            let low = Cell { i: low.i.min(cell.i), j: low.j.min(cell.j) };
            Some([low, Cell { i: high.i.max(cell.i), j: high.j.max(cell.j) }])
        });
        let bounds = extent.map_or(CellBounds { min: bounds.min, max: bounds.min }, |[min, high]| CellBounds {
            min,
            max: Cell { i: high.i + 1, j: high.j + 1 },
        });
        let cells = (0..bounds.width() * bounds.height()).map(|index| byte_of(grid.state(bounds.cell(index))));
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::best());
        encoder.write_all(&cells.collect::<Vec<u8>>())?;
        Ok(Self {
            resolution_m: grid.resolution_m(),
            min: [bounds.min.i, bounds.min.j],
            width: bounds.width() as u32,
            height: bounds.height() as u32,
            deflated: encoder.finish()?,
        })
    }

    /// The grid again. Cells are certainly free, occupied or unknown; their probabilities are lost.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn open(&self) -> io::Result<OccupancyGrid> {
        if self.width > MOST_CELLS || self.height > MOST_CELLS {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a grid larger than any building"));
        }
        let mut bytes = Vec::new();
        let most = u64::from(self.width) * u64::from(self.height);
        DeflateDecoder::new(self.deflated.as_slice()).take(most).read_to_end(&mut bytes)?;
        let min = Cell { i: self.min[0], j: self.min[1] };
        let max = Cell { i: min.i.saturating_add(self.width as i32), j: min.j.saturating_add(self.height as i32) };
        let config = GridConfig { resolution_m: self.resolution_m, ..GridConfig::default() };
        Ok(OccupancyGrid::from_states(config, CellBounds { min, max }, bytes.into_iter().map(state_of)))
    }

    /// Bytes as the paper counts them: one for each cell of the cropped grid.
    #[must_use]
    pub fn raw_bytes(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Bytes when deflated.
    #[must_use]
    pub fn deflated_bytes(&self) -> usize {
        self.deflated.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::Point2;

    #[test]
    fn a_grid_comes_back_as_it_was_and_much_smaller() {
        let bounds = CellBounds { min: Cell { i: -64, j: -32 }, max: Cell { i: 64, j: 96 } };
        let state = |index: usize| match bounds.cell(index) {
            Cell { i, j } if i.abs() == 20 || j == 40 => CellState::Occupied,
            Cell { i, j } if i.abs() < 20 && (0..40).contains(&j) => CellState::Free,
            _ => CellState::Unknown,
        };
        let grid = OccupancyGrid::from_states(GridConfig::default(), bounds, (0..128 * 128).map(state));
        let kept = GridMap::of(&grid).unwrap();
        assert!(kept.deflated_bytes() * 20 < kept.raw_bytes());
        let again = kept.open().unwrap();
        for index in 0..128 * 128 {
            let cell = bounds.cell(index);
            assert_eq!(again.state(cell), grid.state(cell), "{cell:?}");
        }
        assert_eq!(again.state_at(Point2::new(0.0, 0.5)), CellState::Free);
    }
}
