//! Scans drawn into the grid, beam by beam.

use super::growth::MAX_CELL;
use super::{Cell, OccupancyGrid};
use crate::frame::LaserScan;
use crate::pose::{Point2, Pose2};

impl OccupancyGrid {
    /// Adds a scan that another robot took: as [`integrate`](Self::integrate), but the cells do not
    /// count as seen by this robot.
    pub fn integrate_told(&mut self, map_from_base: &Pose2, scan: &LaserScan) {
        self.draw(map_from_base, scan, false);
    }

    /// Adds a scan taken at `map_from_base`: cells on the way of a beam become freer, the cell of
    /// its end more occupied. A cell that some beam of this scan ends in is not freed by the
    /// others, so that thin walls survive grazing beams.
    pub fn integrate(&mut self, map_from_base: &Pose2, scan: &LaserScan) {
        self.draw(map_from_base, scan, true);
    }

    fn draw(&mut self, map_from_base: &Pose2, scan: &LaserScan, is_own: bool) {
        let map_from_sensor = map_from_base * scan.base_from_sensor;
        let origin = Point2::from(map_from_sensor.translation.vector);
        let longest =
            scan.ranges_m.iter().filter(|&&range| scan.is_return(range)).fold(0.0, |a: f64, &b| a.max(b.into()));
        let no_return_m = (scan.range_max_m - self.config.resolution_m).min(self.config.max_no_return_m);
        let reach = longest.min(self.config.max_range_m).max(no_return_m) + 2.0 * self.config.resolution_m;
        let near =
            |value: f64| value.is_finite() && (value.abs() + reach) / self.config.resolution_m < f64::from(MAX_CELL);
        if !near(origin.x) || !near(origin.y) {
            return;
        }
        self.grow_to_contain(self.cell_of(origin - nalgebra::Vector2::repeat(reach)));
        self.grow_to_contain(self.cell_of(origin + nalgebra::Vector2::repeat(reach)));

        let start = self.cell_of(origin);
        let mut hits = Vec::new();
        let mut rays = Vec::with_capacity(scan.ranges_m.len());
        for (index, &range) in scan.ranges_m.iter().enumerate() {
            let is_far = f64::from(range) > self.config.max_range_m;
            let is_return = scan.is_return(range) && !is_far;
            // Below the least range the beam says nothing; NaN neither. Infinite or too far: free
            // up to the greatest.
            let length = if is_return {
                f64::from(range)
            } else if scan.is_return(range) {
                self.config.max_range_m
            } else if f64::from(range) >= scan.range_max_m {
                no_return_m
            } else {
                continue;
            };
            let (sin, cos) = scan.angle(index).sin_cos();
            let end = self.cell_of(map_from_sensor * Point2::new(length * cos, length * sin));
            if is_return {
                hits.extend(self.bounds.index(end));
            }
            rays.push(end);
        }
        hits.sort_unstable();
        hits.dedup();

        // A cell is freed at most once per scan, however many beams cross it: near the robot
        // hundreds do.
        let mut crossed = Vec::with_capacity(rays.len() * 64);
        for end in rays {
            for_each_cell_between(start, end, |cell| crossed.extend(self.bounds.index(cell)));
        }
        crossed.sort_unstable();
        crossed.dedup();
        for index in crossed {
            if hits.binary_search(&index).is_err() {
                self.add(index, self.config.miss_log_odds);
                if is_own {
                    self.seen[index].count(false);
                }
            }
        }
        for index in hits {
            self.add(index, self.config.hit_log_odds);
            if is_own {
                self.seen[index].count(true);
            }
        }
    }

    fn add(&mut self, index: usize, amount: f32) {
        let limit = self.config.max_log_odds;
        let value = &mut self.log_odds[index];
        *value = (*value + amount).clamp(-limit, limit);
    }
}

/// Visits the cells from `start` up to but excluding `end` along a straight line (Bresenham).
fn for_each_cell_between(start: Cell, end: Cell, mut visit: impl FnMut(Cell)) {
    let (di, dj) = ((end.i - start.i).abs(), -(end.j - start.j).abs());
    let (step_i, step_j) = ((end.i - start.i).signum(), (end.j - start.j).signum());
    let mut error = di + dj;
    let mut cell = start;
    while cell != end {
        visit(cell);
        let doubled = 2 * error;
        if doubled >= dj {
            error += dj;
            cell.i += step_i;
        }
        if doubled <= di {
            error += di;
            cell.j += step_j;
        }
    }
}
