//! What a scan saw as free, and whether other points contradict it.
//!
//! A beam that returned from 4 m says that nothing stood nearer in its direction. A point of another scan that would lie
//! well inside is a contradiction, whatever the scan matcher thought of the two; a point near the beam's end supports
//! the match; a point behind it was hidden and says nothing. This is the test against places that look alike.

use fht_proto::ScanRecord;
use fht_robot::frame::LaserScan;
use fht_robot::pose::{Point2, Pose2, from_fixed};
use std::f64::consts::TAU;

/// A scan as ranges by direction, at a sensor pose relative to the robot's base.
#[derive(Clone, Debug)]
pub struct PolarScan {
    base_from_sensor: Pose2,
    angle_min: f64,
    angle_increment: f64,
    /// Metres; 0 where nothing returned.
    ranges_m: Vec<f32>,
}

/// How points are counted against a scan.
#[derive(Clone, Debug)]
pub struct VisibilityConfig {
    /// A point this much nearer than all beams around its direction is a contradiction, metres. Default 0.3.
    pub margin_m: f64,
    /// A point this near to one of the beams' ends is support, metres. Default 0.15.
    pub support_m: f64,
    /// Beams on either side that must agree. Default 2 (±2°), which allows for 3° of heading error.
    pub beams_aside: usize,
}

impl Default for VisibilityConfig {
    fn default() -> Self {
        Self { margin_m: 0.3, support_m: 0.15, beams_aside: 2 }
    }
}

/// Points that fit and points that cannot be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Points near what the scan saw.
    pub supporting: usize,
    /// Points where the scan saw free space.
    pub contradicting: usize,
}

impl Tally {
    /// Share of contradictions among the points that say anything; 0 if none does.
    #[must_use]
    pub fn contradiction(&self) -> f64 {
        self.contradicting as f64 / (self.supporting + self.contradicting).max(1) as f64
    }

    /// Adds another tally.
    pub fn add(&mut self, other: Self) {
        self.supporting += other.supporting;
        self.contradicting += other.contradicting;
    }
}

impl PolarScan {
    /// From a live scan.
    #[must_use]
    pub fn from_scan(scan: &LaserScan) -> Self {
        Self {
            base_from_sensor: scan.base_from_sensor,
            angle_min: scan.angle_min,
            angle_increment: scan.angle_increment,
            ranges_m: scan.ranges_m.iter().map(|&range| if scan.is_return(range) { range } else { 0.0 }).collect(),
        }
    }

    /// From a scan that travelled.
    #[must_use]
    pub fn from_record(record: &ScanRecord) -> Self {
        Self {
            base_from_sensor: from_fixed(record.base_from_sensor),
            angle_min: f64::from(record.angle_min),
            angle_increment: f64::from(record.angle_increment),
            ranges_m: record.ranges_mm.iter().map(|&mm| f32::from(mm) / 1000.0).collect(),
        }
    }

    /// Counts points (in the base frame of this scan's robot) against this scan.
    #[must_use]
    pub fn tally(&self, points: impl Iterator<Item = Point2>, config: &VisibilityConfig) -> Tally {
        let sensor_from_base = self.base_from_sensor.inverse();
        let mut tally = Tally::default();
        for point in points {
            let seen = sensor_from_base * point;
            let range = seen.coords.norm();
            let Some((least, nearest)) = self.around(seen.y.atan2(seen.x), range, config.beams_aside) else { continue };
            if nearest <= config.support_m {
                tally.supporting += 1;
            } else if range < least - config.margin_m {
                tally.contradicting += 1;
            }
        }
        tally
    }

    /// Whether the scan saw the straight way from its sensor to `point` (base frame) as free.
    #[must_use]
    pub fn sees(&self, point: Point2, margin_m: f64) -> bool {
        let seen = self.base_from_sensor.inverse() * point;
        self.around(seen.y.atan2(seen.x), 0.0, 1).is_some_and(|(least, _)| seen.coords.norm() < least - margin_m)
    }

    /// Least range around a direction, and how near the ranges there come to `range`. `None` where a beam is missing or
    /// came back empty.
    fn around(&self, angle: f64, range: f64, aside: usize) -> Option<(f64, f64)> {
        let count = self.ranges_m.len();
        if self.angle_increment.abs() < 1e-9 || count == 0 {
            return None;
        }
        let beams_in_turn = (TAU / self.angle_increment.abs()).round();
        let steps = ((angle - self.angle_min) / self.angle_increment).round().rem_euclid(beams_in_turn);
        let turn = beams_in_turn as usize;
        let (mut least, mut nearest) = (f64::INFINITY, f64::INFINITY);
        for offset in 0..=2 * aside {
            let index = (steps as usize + turn + offset).checked_sub(aside)? % turn;
            let at = f64::from(*self.ranges_m.get(index)?);
            if at <= 0.0 {
                return None;
            }
            least = least.min(at);
            nearest = nearest.min((at - range).abs());
        }
        Some((least, nearest))
    }
}

/// Counts two scans against each other: the points of each in what the other saw. `a_from_b` relates their bases.
#[must_use]
pub fn mutual_tally(
    (scan_a, points_a): (&PolarScan, &[Point2]),
    (scan_b, points_b): (&PolarScan, &[Point2]),
    a_from_b: &Pose2,
    config: &VisibilityConfig,
) -> Tally {
    let b_from_a = a_from_b.inverse();
    let mut tally = scan_a.tally(points_b.iter().map(|point| a_from_b * point), config);
    tally.add(scan_b.tally(points_a.iter().map(|point| b_from_a * point), config));
    tally
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_robot::pose::pose;

    /// A room of `half` metres each way, seen from its middle.
    fn room(half: f64) -> LaserScan {
        let ranges_m = (0..360)
            .map(|degree| {
                let (sin, cos) = f64::from(degree).to_radians().sin_cos();
                (half / cos.abs().max(sin.abs())) as f32
            })
            .collect();
        LaserScan {
            base_from_sensor: pose(-0.032, 0.0, 0.0),
            angle_min: 0.0,
            angle_increment: 1.0_f64.to_radians(),
            range_min_m: 0.12,
            range_max_m: 7.0,
            ranges_m,
        }
    }

    #[test]
    fn the_same_room_supports_and_another_contradicts() {
        let (small, large) = (room(2.0), room(3.0));
        let config = VisibilityConfig::default();
        let pair = |a: &LaserScan, b: &LaserScan, at: Pose2| {
            let (points_a, points_b) = (a.points_in_base(), b.points_in_base());
            let (scan_a, scan_b) = (PolarScan::from_scan(a), PolarScan::from_scan(b));
            mutual_tally((&scan_a, &points_a), (&scan_b, &points_b), &at, &config)
        };
        let turned = pair(&small, &small, pose(0.0, 0.0, std::f64::consts::PI));
        assert!(turned.contradiction() < 0.01 && turned.supporting > 600, "{turned:?}");
        assert!(pair(&large, &small, pose(0.0, 0.0, 0.0)).contradiction() > 0.95);
        assert!(pair(&small, &small, pose(1.0, 0.0, 0.0)).contradiction() > 0.2);
    }

    #[test]
    fn walls_hide_what_is_behind_them() {
        let scan = PolarScan::from_scan(&room(2.0));
        assert!(scan.sees(Point2::new(1.5, 0.0), 0.2));
        assert!(!scan.sees(Point2::new(2.5, 0.0), 0.2));
        let tally = scan.tally([Point2::new(5.0, 0.5)].into_iter(), &VisibilityConfig::default());
        assert_eq!(tally, Tally::default());
    }
}
