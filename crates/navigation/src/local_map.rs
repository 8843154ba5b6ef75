//! The robot's own live grid, in the odometry frame, made of what it saw lately.
//!
//! Odometry drifts, so old scans would smear the walls: the grid is drawn anew from the scans of
//! the last metres from time to time, and what lies farther back is forgotten.

use crate::planning::{PlanConfig, Traversable};
use fht_perception::frame::LaserScan;
use fht_perception::grid::{Cell, CellBounds, GridConfig, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2};
use fht_perception::scan_odometry::Odometry;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// What the live grid remembers.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct LocalMapConfig {
    /// The cells.
    pub grid: GridConfig,
    /// Scans are remembered over this distance driven, metres. Default 40.
    pub memory_m: f64,
    /// The grid is drawn anew after this distance, metres. Default 8.
    pub redraw_m: f64,
    /// Most scans remembered. Default 200.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 100000)))]
    pub scans: usize,
}

impl Default for LocalMapConfig {
    fn default() -> Self {
        Self { grid: GridConfig::default(), memory_m: 40.0, redraw_m: 8.0, scans: 200 }
    }
}

struct Remembered {
    odom_from_base: Pose2,
    odometer_m: f64,
    scan: LaserScan,
}

/// The live grid.
pub struct LocalMap {
    config: LocalMapConfig,
    grid: OccupancyGrid,
    scans: VecDeque<Remembered>,
    drawn_at_m: f64,
}

impl LocalMap {
    /// Empty.
    #[must_use]
    pub fn new(config: LocalMapConfig) -> Self {
        Self { grid: OccupancyGrid::new(config.grid.clone()), config, scans: VecDeque::new(), drawn_at_m: 0.0 }
    }

    /// The grid, in the odometry frame.
    #[must_use]
    pub fn grid(&self) -> &OccupancyGrid {
        &self.grid
    }

    /// Adds the scan of a frame.
    pub fn integrate(&mut self, odometry: &Odometry, scan: &LaserScan) {
        self.grid.integrate(&odometry.odom_from_base, scan);
        if odometry.is_keyframe {
            let remembered = Remembered {
                odom_from_base: odometry.odom_from_base,
                odometer_m: odometry.odometer_m,
                scan: scan.clone(),
            };
            self.scans.push_back(remembered);
        }
        if odometry.odometer_m - self.drawn_at_m >= self.config.redraw_m {
            self.redraw(odometry.odometer_m);
        }
    }

    fn redraw(&mut self, odometer_m: f64) {
        let oldest = odometer_m - self.config.memory_m;
        while self.scans.len() > self.config.scans || self.scans.front().is_some_and(|kept| kept.odometer_m < oldest) {
            self.scans.pop_front();
        }
        self.grid = OccupancyGrid::new(self.config.grid.clone());
        for kept in &self.scans {
            self.grid.integrate(&kept.odom_from_base, &kept.scan);
        }
        self.drawn_at_m = odometer_m;
    }

    /// Where the robot's centre may be, in a rectangle that contains both points and `reach_m`
    /// metres more each way, as far as it lies within `reach_m` of what the grid knows: a point far
    /// outside costs no memory.
    #[must_use]
    pub fn space_around(&self, a: Point2, b: Point2, reach_m: f64, config: &PlanConfig) -> Traversable {
        let low = self.grid.cell_of(Point2::new(a.x.min(b.x) - reach_m, a.y.min(b.y) - reach_m));
        let high = self.grid.cell_of(Point2::new(a.x.max(b.x) + reach_m, a.y.max(b.y) + reach_m));
        let known = self.grid.bounds();
        let margin = (reach_m / self.grid.resolution_m()).ceil() as i32;
        let least = |cell: i32, known: i32| cell.max(known.saturating_sub(margin));
        // Casts of what is far away saturate, so no sum of theirs may wrap around.
        let greatest = |cell: i32, known: i32| cell.saturating_add(1).min(known.saturating_add(margin));
        let min = Cell { i: least(low.i, known.min.i), j: least(low.j, known.min.j) };
        let max = Cell { i: greatest(high.i, known.max.i).max(min.i), j: greatest(high.j, known.max.j).max(min.j) };
        Traversable::in_region(&self.grid, config, CellBounds { min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_far_away_costs_no_memory() {
        let scan = LaserScan::all_round(360, |_, _| 3.0);
        let mut map = LocalMap::new(LocalMapConfig::default());
        map.grid.integrate(&Pose2::identity(), &scan);
        let known = map.grid().bounds();
        let here = Point2::origin();
        for (x, y) in [(1e9, 0.0), (-1e9, 1e9), (1e300, 1e300), (f64::INFINITY, 0.0)] {
            let far = Point2::new(x, y);
            let space = map.space_around(here, far, 3.0, &PlanConfig::default());
            assert!(space.bounds().width() <= known.width() + 120 && space.bounds().height() <= known.height() + 120);
            assert!(space.is_passable(space.cell_of(here)));
            let nowhere = map.space_around(far, far, 3.0, &PlanConfig::default());
            assert!(nowhere.bounds().width() <= known.width() + 120);
        }
    }
}
