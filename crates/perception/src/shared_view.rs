//! What two scans say of each other: whether both can have been taken where somebody says.
//!
//! Each scan is a polygon of free space around its scanner. A point of the other scan that lies on
//! its border agrees, one well inside contradicts, and one outside is hidden and says nothing.
//! Whoever walks through, a door that opens or a slope that beams hit changes a part of what is
//! seen; a robot that was carried off sees another place altogether.

use crate::frame::LaserScan;
use crate::pose::{Point2, Pose2};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// When two scans contradict each other.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SharedViewConfig {
    /// A point this far before or behind what the other scan measured still agrees, metres. Default
    /// 0.1.
    pub margin_m: f64,
    /// The same for each metre of range: what a heading that is off by as much does to a slanted
    /// wall. Default 0.02.
    pub margin_per_m: f64,
    /// Points farther from their scanner are left out, metres. Default 30, as in the grid.
    pub reach_m: f64,
    /// Fewest points that both scans can judge; of fewer nothing is concluded. Default 40, as in
    /// the matching.
    pub least_points: usize,
    /// Two scans are of different places when more than this share of what they can judge
    /// contradicts. Default 0.5: of pairs 0.2 m apart by the wheels' word, one in a hundred
    /// or fewer does in two logs, one in twenty in two others; of pairs from different places,
    /// nineteen in twenty.
    pub most_contradicting: f64,
    /// They are of one place when less than this share does. Default 0.2. In between nothing is
    /// concluded.
    pub least_contradicting: f64,
}

impl Default for SharedViewConfig {
    fn default() -> Self {
        Self {
            margin_m: 0.1,
            margin_per_m: 0.02,
            reach_m: 30.0,
            least_points: 40,
            most_contradicting: 0.5,
            least_contradicting: 0.2,
        }
    }
}

/// Whether two scans can both be right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// They show one place.
    Agree,
    /// They show different places.
    Contradict,
    /// They share too little, or too much has changed.
    Open,
}

/// What two scans say of each other, in numbers of points of both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SharedView {
    /// Where the other scan's beams end, too.
    pub agreeing: usize,
    /// Where the other scan saw through.
    pub contradicting: usize,
}

impl SharedView {
    /// Compares scans `a` and `b`, given the pose of the robot of `b` in the frame of that of `a`.
    #[must_use]
    pub fn of(a: &LaserScan, b: &LaserScan, a_from_b: &Pose2, config: &SharedViewConfig) -> Self {
        let mut view = Self::default();
        view.count(a, b, a_from_b, config);
        view.count(b, a, &a_from_b.inverse(), config);
        view
    }

    /// Share of the points that contradict, of those that can be judged, 0 to 1.
    #[must_use]
    pub fn contradicting_share(&self) -> f64 {
        self.contradicting as f64 / (self.agreeing + self.contradicting).max(1) as f64
    }

    /// Whether both scans can be right.
    #[must_use]
    pub fn verdict(&self, config: &SharedViewConfig) -> Verdict {
        let share = self.contradicting_share();
        if self.agreeing + self.contradicting < config.least_points {
            Verdict::Open
        } else if share > config.most_contradicting {
            Verdict::Contradict
        } else if share < config.least_contradicting {
            Verdict::Agree
        } else {
            Verdict::Open
        }
    }

    /// Counts the points of `other` by what `scan` says of them.
    fn count(&mut self, scan: &LaserScan, other: &LaserScan, base_from_other: &Pose2, config: &SharedViewConfig) {
        let sensor_from_other = scan.base_from_sensor.inverse() * base_from_other;
        let origin = Point2::from(other.base_from_sensor.translation.vector);
        for point in other.points_in_base() {
            if (point - origin).norm() > config.reach_m {
                continue;
            }
            let place = sensor_from_other * point;
            let Some((least_m, greatest_m)) = ranges_towards(scan, place) else { continue };
            let range_m = place.coords.norm();
            let margin_m = config.margin_m + config.margin_per_m * range_m;
            if range_m < least_m - margin_m {
                self.contradicting += 1;
            } else if range_m <= greatest_m + margin_m {
                self.agreeing += 1;
            }
        }
    }
}

/// The least and the greatest range of the three beams next to the direction of a place in the
/// sensor's frame; `None` where no beam looks or the least did not return.
fn ranges_towards(scan: &LaserScan, place: Point2) -> Option<(f64, f64)> {
    let sign = scan.angle_increment.signum();
    let step = scan.angle_increment.abs();
    let turn = (sign * (place.y.atan2(place.x) - scan.angle_min)).rem_euclid(TAU);
    let index = (turn / step).round();
    if !index.is_finite() || index >= scan.ranges_m.len() as f64 {
        return None;
    }
    let index = index as usize;
    let around = &scan.ranges_m[index.saturating_sub(1)..(index + 2).min(scan.ranges_m.len())];
    let far = |range: f32| if scan.is_return(range) { f64::from(range) } else { f64::INFINITY };
    let least_m = around.iter().map(|range| far(*range)).fold(f64::INFINITY, f64::min);
    let greatest_m = around.iter().filter(|range| scan.is_return(**range)).map(|range| f64::from(*range));
    least_m.is_finite().then(|| (least_m, greatest_m.fold(0.0, f64::max)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::pose;

    /// What is seen at `x`, `y` of a room, 8 m by 5 m around the origin, with somebody standing at
    /// each of `people`.
    fn seen_from(x: f64, y: f64, people: &[(f64, f64)]) -> LaserScan {
        LaserScan::all_round(360, |cos, sin| {
            let wall = |along: f64, at: f64, half: f64| if along > 0.0 { half - at } else { half + at } / along.abs();
            let room = wall(cos, x, 4.0).min(wall(sin, y, 2.5));
            let body = people.iter().filter_map(|&(px, py)| {
                let (ahead, aside) = ((px - x) * cos + (py - y) * sin, (py - y) * cos - (px - x) * sin);
                (ahead > 0.0 && aside.abs() < 0.3).then_some(ahead - 0.3)
            });
            body.fold(room, f64::min)
        })
    }

    #[test]
    fn a_crowd_changes_a_part_and_another_place_the_whole() {
        let config = SharedViewConfig::default();
        let here = seen_from(-1.0, 0.5, &[]);
        let driven = pose(0.4, 0.2, 0.0);
        let next = seen_from(-0.6, 0.7, &[]);
        let view = SharedView::of(&here, &next, &driven, &config);
        assert!(view.contradicting == 0 && view.agreeing > 600, "{view:?}");
        assert_eq!(view.verdict(&config), Verdict::Agree);
        let crowd = [(0.5, 1.0), (0.6, -0.4), (-2.0, 1.5), (-1.2, -0.7), (1.5, 0.2)];
        let view = SharedView::of(&here, &seen_from(-0.6, 0.7, &crowd), &driven, &config);
        assert!(view.contradicting > 80 && view.verdict(&config) != Verdict::Contradict, "{view:?}");
        // Carried to a corner, and the wheels know nothing of it.
        let view = SharedView::of(&here, &seen_from(3.2, -1.8, &[]), &driven, &config);
        assert_eq!(view.verdict(&config), Verdict::Contradict, "{view:?}");
    }

    #[test]
    fn scanners_may_be_mounted_and_count_as_they_like() {
        let config = SharedViewConfig::default();
        let a = seen_from(0.0, 0.0, &[]);
        let mut b = seen_from(0.5, 0.2, &[]);
        // The same beams, the other way round, of a scanner that looks aside.
        b.ranges_m.reverse();
        b.angle_min = 359.0_f64.to_radians() - 0.7;
        b.angle_increment = -b.angle_increment;
        b.base_from_sensor = pose(0.2, -0.1, 0.7);
        let view = SharedView::of(&a, &b, &pose(0.3, 0.3, 0.0), &config);
        assert!(view.contradicting == 0 && view.agreeing > 600, "{view:?}");
    }

    #[test]
    fn scans_that_share_nothing_conclude_nothing() {
        let config = SharedViewConfig::default();
        let half = |mut scan: LaserScan| {
            scan.ranges_m.truncate(180);
            scan
        };
        let (a, b) = (half(seen_from(0.0, 0.0, &[])), half(seen_from(0.0, 0.0, &[])));
        let view = SharedView::of(&a, &b, &pose(0.0, 0.0, std::f64::consts::PI), &config);
        assert_eq!(view.verdict(&config), Verdict::Open, "{view:?}");
        let blind = LaserScan { ranges_m: vec![f32::NAN; 360], ..a.clone() };
        assert_eq!(SharedView::of(&a, &blind, &pose(0.0, 0.0, 0.0), &config), SharedView::default());
    }
}
