//! Search in a whole building: branch and bound over pictures of its walls, best first.
//!
//! A window of places is bounded by letting each point fit as well as it does anywhere in the
//! window (Hess et al., "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016). Windows are opened
//! best first, so the alignments come out in order, and the work can be bounded: what was not found
//! by then fits less well than what was. The first windows of one heading are bounded all at once:
//! each point adds a shifted picture to theirs.

mod islands;
mod windows;

use crate::pose::{Point2, Pose2, wrap_angle};
use islands::{Ground, Island, Layout, lay_out};
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
    /// What is shown where, by column.
    islands: Vec<Island>,
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
    /// cell. `None` without either. Parts of a building that are far apart lie side by side in the
    /// picture; of more than it holds, those with the fewest walls are left out.
    #[must_use]
    pub fn new(walls: &[Point2], places: &[Point2], config: &BranchAndBoundConfig) -> Option<Self> {
        let resolution = config.resolution_m;
        // All points of a scan taken anywhere inside fall into the picture.
        let side = 1_usize << config.levels;
        let margin = config.reach_m + config.blur_m + resolution * (2 * side) as f64;
        let lay_out = |parts: &[Ground]| lay_out(parts, resolution, margin, side, MOST_CELLS);
        if walls.is_empty() || places.is_empty() {
            return None;
        }
        let mut parts = vec![Ground { walls: walls.to_vec(), places: places.to_vec() }];
        let mut layout = lay_out(&parts);
        if layout.islands.contains(&None) {
            parts = islands::parts(walls, places, 2.0 * margin);
            layout = lay_out(&parts);
        }
        let Layout { width, height, islands } = layout;
        let mut pyramid = Self {
            config: config.clone(),
            islands: islands.iter().flatten().copied().collect(),
            width,
            height,
            fits: Vec::new(),
            standable: Vec::new(),
            phases: Vec::new(),
        };
        if pyramid.islands.is_empty() {
            return None;
        }
        let (mut fits, mut standable) = (vec![0_u8; width * height], vec![0_u8; width * height]);
        for (part, island) in parts.iter().zip(&islands) {
            let Some(island) = island else { continue };
            part.walls.iter().for_each(|wall| pyramid.draw(island, wall, &mut fits));
            for place in &part.places {
                let (i, j) = island.cell_of(place);
                standable[j * width + i] = 1;
            }
        }
        pyramid.fits = pyramid.widened(fits);
        pyramid.standable = pyramid.widened(standable);
        pyramid.phases = pyramid.phases();
        Some(pyramid)
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

    fn draw(&self, island: &Island, wall: &Point2, fits: &mut [u8]) {
        let (resolution, blur) = (self.config.resolution_m, self.config.blur_m);
        let (i, j) = island.cell_of(wall);
        let reach = (blur / resolution).ceil() as usize;
        for y in j.saturating_sub(reach)..=(j + reach).min(self.height - 1) {
            for x in i.saturating_sub(reach)..=(i + reach).min(self.width - 1) {
                let centre = island.point_at(x as f64 + 0.5, y as f64 + 0.5);
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
