//! Search in a whole building: branch and bound over pictures of its walls, best first.
//!
//! A window of places is bounded by letting each point fit as well as it does anywhere in the
//! window (Hess et al., "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016). Windows are opened
//! best first, so the alignments come out in order, and the work can be bounded: what was not found
//! by then fits less well than what was. The first windows of one heading are bounded all at once:
//! each point adds a shifted picture to theirs.

mod windows;

use crate::pose::{Point2, Pose2, wrap_angle};
use serde::{Deserialize, Serialize};

/// How a building is searched.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BranchAndBoundConfig {
    /// Side of a cell of the picture, metres. Default 0.2.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.005, max = 1.0)))]
    pub resolution_m: f64,
    /// A point this far from a wall fits not at all, one on it fully, metres. Default 0.3.
    pub blur_m: f64,
    /// Step of the headings, radians. Default 0.05.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 1.0)))]
    pub step_rad: f64,
    /// The first windows are 2 to this many cells wide. Default 2.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 12)))]
    pub levels: u32,
    /// Points of the scan that are compared. Default 80, at most 255.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 100000)))]
    pub points: usize,
    /// Points farther from the scan's origin are left out, metres. Default 12.
    pub reach_m: f64,
    /// Alignments to find. Default 16.
    pub found: usize,
    /// They differ by at least this, metres. Default 0.6.
    pub apart_m: f64,
    /// Or by this, radians. Default 0.3.
    pub apart_rad: f64,
    /// Alignments that fit worse than this share of the best are left out. Default 0.75.
    pub least_of_best: f64,
    /// And those that fit worse than this, 0 to 1. Default 0.3.
    pub least_fit: f64,
    /// Windows to look at, after the first ones. Default 40,000.
    pub windows: usize,
}

impl Default for BranchAndBoundConfig {
    fn default() -> Self {
        Self {
            resolution_m: 0.2,
            blur_m: 0.3,
            step_rad: 0.05,
            levels: 2,
            points: 80,
            reach_m: 12.0,
            found: 16,
            apart_m: 0.6,
            apart_rad: 0.3,
            least_of_best: 0.75,
            least_fit: 0.3,
            windows: 40_000,
        }
    }
}

impl BranchAndBoundConfig {
    /// Around the building: all points of a scan taken anywhere inside fall into the picture.
    fn margin_m(&self) -> f64 {
        self.reach_m + self.blur_m + self.resolution_m * (2_usize << self.levels) as f64
    }

    fn size_in_cells(&self, low: Point2, high: Point2) -> nalgebra::Vector2<f64> {
        (high - low).map(|metres| (metres + 2.0 * self.margin_m()) / self.resolution_m)
    }
}

/// Places that something else than the scan speaks for, as a picture of them does.
#[derive(Clone, Copy, Debug)]
pub struct Favour {
    /// Their middle.
    pub centre: Point2,
    /// How far from it they are, metres.
    pub radius_m: f64,
    /// What is added to the fit, which is from 0 to 1.
    pub bonus: f64,
}

/// Where the scan may have been taken.
#[derive(Clone, Copy, Debug)]
pub struct PoseCandidate {
    /// Pose of the scan's frame in the map, true to about half a cell and half a step.
    pub map_from_scan: Pose2,
    /// How well its points fit, 0 to 1.
    pub fit: f64,
}

/// Pictures of a building's walls and of where a robot can stand, each cell holding the best of
/// ever wider windows.
#[derive(Clone, Debug)]
pub struct WallPyramid {
    config: BranchAndBoundConfig,
    min: Point2,
    width: usize,
    height: usize,
    /// By level: how well a point fits at best in the window of 2^level cells that begins here, 0
    /// to 255.
    fits: Vec<Vec<u8>>,
    /// By level: whether a robot can stand anywhere in the window.
    standable: Vec<Vec<u8>>,
    /// The widest windows sorted by where they begin within a square of the first windows:
    /// `[row % side][column % side]`.
    phases: Vec<Vec<u8>>,
}

/// Cells that a picture may have: 64 million, 2.5 km² at 0.2 m.
const MOST_CELLS: f64 = 64e6;

impl WallPyramid {
    /// Draws `walls` (points on them) and `places` where a robot can stand, no farther apart than a
    /// cell. `None` without either, or when they are too far apart for a building.
    #[must_use]
    pub fn new(walls: &[Point2], places: &[Point2], config: &BranchAndBoundConfig) -> Option<Self> {
        let first = walls.first()?;
        let all = walls.iter().chain(places);
        let (low, high) = all.fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
        if places.is_empty() || !Self::holds(low, high, config) {
            return None;
        }
        let side = 1_usize << config.levels;
        let (margin, size) = (config.margin_m(), config.size_in_cells(low, high));
        let whole = |cells: f64| (cells.ceil() as usize + 1).next_multiple_of(side);
        let (width, height) = (whole(size.x), whole(size.y));
        let min = Point2::new(low.x - margin, low.y - margin);
        let mut pyramid = Self {
            config: config.clone(),
            min,
            width,
            height,
            fits: Vec::new(),
            standable: Vec::new(),
            phases: Vec::new(),
        };
        let mut fits = vec![0_u8; width * height];
        walls.iter().for_each(|wall| pyramid.draw(wall, &mut fits));
        let mut standable = vec![0_u8; width * height];
        for place in places {
            let (i, j) = pyramid.cell_of(place);
            standable[j * width + i] = 1;
        }
        pyramid.fits = pyramid.widened(fits);
        pyramid.standable = pyramid.widened(standable);
        pyramid.phases = pyramid.phases();
        Some(pyramid)
    }

    /// Whether a picture can hold what lies between two corners.
    #[must_use]
    pub fn holds(low: Point2, high: Point2, config: &BranchAndBoundConfig) -> bool {
        let size = config.size_in_cells(low, high);
        (size.x * size.y).is_finite() && size.x * size.y <= MOST_CELLS
    }

    fn phases(&self) -> Vec<Vec<u8>> {
        let side = 1_usize << self.config.levels;
        let Some(widest) = self.fits.last() else { return Vec::new() };
        let phase = |index: usize| {
            let (row, column) = (index / side, index % side);
            let rows = (row..self.height).step_by(side);
            rows.flat_map(|j| (column..self.width).step_by(side).map(move |i| widest[j * self.width + i])).collect()
        };
        (0..side * side).map(phase).collect()
    }

    fn cell_of(&self, point: &Point2) -> (usize, usize) {
        let cell = (point - self.min) / self.config.resolution_m;
        (cell.x as usize, cell.y as usize)
    }

    fn draw(&self, wall: &Point2, fits: &mut [u8]) {
        let (resolution, blur) = (self.config.resolution_m, self.config.blur_m);
        let (i, j) = self.cell_of(wall);
        let reach = (blur / resolution).ceil() as usize;
        for y in j.saturating_sub(reach)..=(j + reach).min(self.height - 1) {
            for x in i.saturating_sub(reach)..=(i + reach).min(self.width - 1) {
                let centre = self.min + nalgebra::Vector2::new(x as f64 + 0.5, y as f64 + 0.5) * resolution;
                let fit = (255.0 * (1.0 - (centre - wall).norm() / blur).max(0.0)) as u8;
                let cell = &mut fits[y * self.width + x];
                *cell = (*cell).max(fit);
            }
        }
    }

    /// The picture and its wider windows: each doubles the one before.
    fn widened(&self, finest: Vec<u8>) -> Vec<Vec<u8>> {
        let mut levels = vec![finest];
        for level in 0..self.config.levels {
            let step = 1_usize << level;
            let narrow = &levels[level as usize];
            let mut wide = narrow.clone();
            for j in 0..self.height {
                let row = &mut wide[j * self.width..(j + 1) * self.width];
                if j + step < self.height {
                    let below = &narrow[(j + step) * self.width..(j + step + 1) * self.width];
                    row.iter_mut().zip(below).for_each(|(cell, other)| *cell = (*cell).max(*other));
                }
                for i in 0..self.width.saturating_sub(step) {
                    row[i] = row[i].max(row[i + step]);
                }
            }
            levels.push(wide);
        }
        levels
    }

    fn yaw_of(&self, turn: usize) -> f64 {
        wrap_angle(turn as f64 * self.config.step_rad)
    }

    /// How well points fit, as a sum of 0 to 255 for each, in the window that begins at cell (i,
    /// j).
    fn fit(&self, points: &[[i32; 2]], level: u32, i: usize, j: usize) -> u32 {
        let fits = &self.fits[level as usize];
        let base = (j * self.width + i) as i32;
        let cell = |&[x, y]: &[i32; 2]| (base + y * self.width as i32 + x) as usize;
        points.iter().map(|point| fits.get(cell(point)).map_or(0, |fit| u32::from(*fit))).sum()
    }

    /// The same for all first windows, row by row.
    fn first_fits(&self, points: &[[i32; 2]]) -> Vec<u16> {
        let side = 1_i32 << self.config.levels;
        let (columns, rows) = (self.width / side as usize, self.height / side as usize);
        let mut sums = vec![0_u16; columns * rows];
        for &[x, y] in points {
            let phase = &self.phases[(y.rem_euclid(side) * side + x.rem_euclid(side)) as usize];
            // Window w looks at cell w + shift of the phase; what that would take out of the
            // picture belongs to windows in which no robot can stand.
            let shift = i64::from(y.div_euclid(side)) * columns as i64 + i64::from(x.div_euclid(side));
            let first = usize::try_from(-shift).unwrap_or(0);
            let from = usize::try_from(shift).unwrap_or(0);
            let (Some(sums), Some(phase)) = (sums.get_mut(first..), phase.get(from..)) else { continue };
            sums.iter_mut().zip(phase).for_each(|(sum, fit)| *sum += u16::from(*fit));
        }
        sums
    }
}

#[cfg(test)]
mod tests;
