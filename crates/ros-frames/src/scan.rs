//! Laser scans as messages, and back.

use crate::tf::Mount;
use fht_perception::frame::LaserScan;
use fht_ros_messages::msg;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A scanner farther than this from the robot's centre is not on it, metres.
pub(crate) const MOUNT_LIMIT_M: f64 = 1000.0;
/// Most beams of a scan.
const BEAM_LIMIT: usize = 100_000;

/// How scans are read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ScanConfig {
    /// Ranges at or above this are not returns, whatever the scanner says, metres. 200.
    pub range_max_m: f64,
}

impl Default for ScanConfig {
    fn default() -> Self {
        Self { range_max_m: 200.0 }
    }
}

/// The scan in a message, from a scanner mounted on the robot as in `mount`. Beams are put in
/// counter-clockwise order.
///
/// A beam that reads infinity was free up to the longest range (REP-117). A finite number at or
/// above the scanner's own `range_max` is discarded, as `sensor_msgs/LaserScan` demands: old
/// scanners report it for black walls and glass. So is 0, which drivers write for any failure.
///
/// `None` if the message makes no sense: no beams, angles that are not finite or exceed a turn, a
/// range limit of 0, a scanner that is not on the robot.
#[must_use]
pub fn scan_of(message: &msg::LaserScanMsg, mount: &Mount, config: &ScanConfig) -> Option<LaserScan> {
    let beams = message.ranges.len();
    let angle_increment = exact_increment(message.angle_increment);
    let angle_min = exact_angle(message.angle_min, angle_increment);
    let span = angle_increment.abs() * (beams.saturating_sub(1)) as f64;
    let is_turn = angle_increment != 0.0 && span < 1.01 * TAU && angle_min.abs() < 10.0 * TAU;
    let is_ranged = !message.range_max.is_nan() && !message.range_min.is_nan();
    let range_max_m = decimal(message.range_max).min(config.range_max_m);
    let range_min_m = decimal(message.range_min).max(0.0);
    let is_mounted = mount.base_from_sensor.translation.vector.norm() <= MOUNT_LIMIT_M;
    if !(1..=BEAM_LIMIT).contains(&beams) || !is_turn || !is_ranged || !is_mounted || range_max_m <= range_min_m {
        return None;
    }
    let is_discarded = |range: f32| range.is_finite() && (range >= message.range_max || range <= 0.0);
    let mut scan = LaserScan {
        base_from_sensor: mount.base_from_sensor,
        angle_min,
        angle_increment,
        range_min_m,
        range_max_m,
        ranges_m: message.ranges.iter().map(|&range| if is_discarded(range) { f32::NAN } else { range }).collect(),
    };
    if mount.is_upside_down {
        scan.angle_min = -scan.angle_min;
        scan.angle_increment = -scan.angle_increment;
    }
    if scan.angle_increment < 0.0 {
        scan.angle_min = scan.angle(beams - 1);
        scan.angle_increment = -scan.angle_increment;
        scan.ranges_m.reverse();
    }
    Some(scan)
}

/// The message of a scan. Ranges are written as they are; angles and limits are rounded to single
/// precision, from which [`scan_of`] recovers what scanners have: a whole number of beams in a
/// turn, and decimal limits.
#[must_use]
pub fn scan_message(scan: &LaserScan, header: msg::HeaderMsg, scan_time_s: f64) -> msg::LaserScanMsg {
    let last = scan.ranges_m.len().saturating_sub(1);
    msg::LaserScanMsg {
        header,
        angle_min: scan.angle_min as f32,
        angle_max: scan.angle(last) as f32,
        angle_increment: scan.angle_increment as f32,
        time_increment: 0.0,
        scan_time: scan_time_s as f32,
        range_min: scan.range_min_m as f32,
        range_max: scan.range_max_m as f32,
        ranges: scan.ranges_m.clone(),
        intensities: Vec::new(),
    }
}

/// The number that a person would have written: 0.12, where single precision holds 0.119999997.
/// Infinity stays infinite.
fn decimal(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// The increment in double precision: a whole number of beams in a turn if single precision cannot
/// tell it from one. Over 360 beams single precision alone is off by 1e-5 rad.
fn exact_increment(increment: f32) -> f64 {
    let beams = (TAU / f64::from(increment)).round();
    let exact = TAU / beams;
    if exact as f32 == increment { exact } else { f64::from(increment) }
}

/// The angle in double precision: a multiple of half the increment if single precision cannot tell
/// it from one.
fn exact_angle(angle: f32, increment: f64) -> f64 {
    let half = 0.5 * increment;
    let exact = (f64::from(angle) / half).round() * half;
    if exact as f32 == angle { exact } else { f64::from(angle) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::{Point2, pose};
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn message(angle_min: f64, angle_increment: f64, ranges: Vec<f32>) -> msg::LaserScanMsg {
        msg::LaserScanMsg {
            angle_min: angle_min as f32,
            angle_increment: angle_increment as f32,
            range_min: 0.12,
            range_max: 7.0,
            ranges,
            ..msg::LaserScanMsg::default()
        }
    }

    fn points(message: &msg::LaserScanMsg, mount: &Mount) -> Vec<Point2> {
        scan_of(message, mount, &ScanConfig::default()).unwrap().points_in_base()
    }

    fn near(found: &[Point2], wanted: &[(f64, f64)]) {
        assert_eq!(found.len(), wanted.len(), "{found:?}");
        for (point, (x, y)) in found.iter().zip(wanted) {
            assert!((point - Point2::new(*x, *y)).norm() < 1e-6, "{found:?}, wanted {wanted:?}");
        }
    }

    #[test]
    fn clockwise_and_upside_down_scanners_are_turned_round() {
        let mount = Mount { base_from_sensor: pose(1.0, 0.0, 0.0), is_upside_down: false, tilt_rad: 0.0 };
        let upside_down = Mount { is_upside_down: true, ..mount };
        // Ahead 1 m and left 2 m, of the sensor.
        let left = message(0.0, FRAC_PI_2, vec![1.0, 2.0]);
        let right = message(0.0, -FRAC_PI_2, vec![1.0, 2.0]);
        near(&points(&left, &mount), &[(2.0, 0.0), (1.0, 2.0)]);
        near(&points(&right, &mount), &[(1.0, -2.0), (2.0, 0.0)]);
        near(&points(&left, &upside_down), &[(1.0, -2.0), (2.0, 0.0)]);
        near(&points(&right, &upside_down), &[(2.0, 0.0), (1.0, 2.0)]);
        for (message, mount) in [(&left, &mount), (&right, &mount), (&left, &upside_down), (&right, &upside_down)] {
            assert!(scan_of(message, mount, &ScanConfig::default()).unwrap().angle_increment > 0.0);
        }
    }

    #[test]
    fn what_is_no_range_is_no_return() {
        let ranges = vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 0.1, 7.0, 9.0, 6.9, 0.12];
        let scan = scan_of(&message(-PI, 0.1, ranges), &Mount::identity(), &ScanConfig::default()).unwrap();
        let returns: Vec<bool> = scan.ranges_m.iter().map(|&range| scan.is_return(range)).collect();
        assert_eq!(returns.iter().filter(|is| **is).count(), 1);
        assert!(returns[8]);
        // Infinity means free; 0, NaN and finite ranges that are too far are discarded; near ones
        // are too near.
        assert!(
            scan.ranges_m[1].is_infinite() && scan.is_too_near(scan.ranges_m[2]) && scan.is_too_near(scan.ranges_m[5])
        );
        assert!([3, 4, 6, 7].iter().all(|&index: &usize| scan.ranges_m[index].is_nan()));
        assert_eq!((scan.range_min_m, scan.range_max_m), (0.12, 7.0));
    }

    #[test]
    fn scans_without_sense_are_refused() {
        let good = message(0.0, 0.1, vec![1.0; 10]);
        let bad = [
            msg::LaserScanMsg { ranges: vec![], ..good.clone() },
            msg::LaserScanMsg { angle_increment: 0.0, ..good.clone() },
            msg::LaserScanMsg { angle_increment: f32::NAN, ..good.clone() },
            msg::LaserScanMsg { angle_increment: 1.0, ..good.clone() },
            msg::LaserScanMsg { angle_min: f32::INFINITY, ..good.clone() },
            msg::LaserScanMsg { range_max: f32::NAN, range_min: f32::NAN, ..good.clone() },
            msg::LaserScanMsg { range_max: 0.0, ..good.clone() },
            msg::LaserScanMsg { ranges: vec![1.0; BEAM_LIMIT + 1], angle_increment: 1e-6, ..good.clone() },
        ];
        for message in bad {
            assert!(scan_of(&message, &Mount::identity(), &ScanConfig::default()).is_none(), "{message:?}");
        }
        let far = Mount { base_from_sensor: pose(1e7, 0.0, 0.0), ..Mount::identity() };
        assert!(scan_of(&good, &far, &ScanConfig::default()).is_none());
        let endless = msg::LaserScanMsg { range_max: f32::INFINITY, ..good };
        assert_eq!(scan_of(&endless, &Mount::identity(), &ScanConfig::default()).unwrap().range_max_m, 200.0);
    }

    proptest! {
        #[test]
        fn full_turns_and_half_turns_come_back_exactly(beams in 4_usize..4000, quarter in 0_u32..4, minimum in 0_u32..50) {
            let angle_increment = TAU / beams as f64;
            let angle_min = [0.0, -PI, -FRAC_PI_2, -0.5 * angle_increment][quarter as usize];
            let is_multiple = quarter == 0 || quarter == 3 || beams.is_multiple_of(4);
            let scan = LaserScan {
                base_from_sensor: Mount::identity().base_from_sensor,
                angle_min,
                angle_increment,
                range_min_m: f64::from(minimum) / 100.0,
                range_max_m: 29.9,
                ranges_m: vec![1.5; beams],
            };
            let back = scan_message(&scan, msg::HeaderMsg::default(), 0.1);
            let back = scan_of(&back, &Mount::identity(), &ScanConfig::default()).unwrap();
            prop_assert_eq!(back.angle_increment, scan.angle_increment);
            prop_assert_eq!((back.range_min_m, back.range_max_m), (scan.range_min_m, scan.range_max_m));
            if is_multiple {
                prop_assert!((back.angle_min - scan.angle_min).abs() < 1e-15 * 4.0);
            }
        }
    }
}
