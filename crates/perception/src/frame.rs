//! Sensor frames: what wheels, LiDAR and cameras said at one instant.

use crate::pose::{Point2, Pose2, from_fixed, to_fixed};
use fht_proto::ScanRecord;
use image::RgbImage;

/// A planar laser scan. Beam `i` looks at `angle_min + i·angle_increment` in the sensor's frame
/// (counter-clockwise).
#[derive(Clone, Debug)]
pub struct LaserScan {
    /// Pose of the sensor on the robot (the lever arm).
    pub base_from_sensor: Pose2,
    /// Angle of the first beam, radians.
    pub angle_min: f64,
    /// Angle between beams, radians.
    pub angle_increment: f64,
    /// Shortest range that counts as a return, metres.
    pub range_min_m: f64,
    /// Ranges at or above this are no return: the beam was free up to here, metres.
    pub range_max_m: f64,
    /// Ranges, metres (REP-117). At or above `range_max_m`, infinity included: no return, the beam
    /// was free. Below `range_min_m`, negative infinity and 0 included: something is too near to be
    /// measured. NaN: nothing is known, as with a sensor that says 0 for any failure.
    pub ranges_m: Vec<f32>,
}

impl LaserScan {
    /// Whether a range is a return.
    #[must_use]
    pub fn is_return(&self, range_m: f32) -> bool {
        let range = f64::from(range_m);
        range.is_finite() && range >= self.range_min_m && range < self.range_max_m
    }

    /// Whether a range says that something is nearer than the scanner can measure.
    #[must_use]
    pub fn is_too_near(&self, range_m: f32) -> bool {
        f64::from(range_m) < self.range_min_m
    }

    /// Angle of beam `index` in the sensor's frame, radians.
    #[must_use]
    pub fn angle(&self, index: usize) -> f64 {
        self.angle_min + index as f64 * self.angle_increment
    }

    /// End points of the beams that returned, in the frame of the robot's base, in the order of the
    /// beams.
    #[must_use]
    pub fn points_in_base(&self) -> Vec<Point2> {
        let returns = self.ranges_m.iter().enumerate().filter(|&(_, &range)| self.is_return(range));
        returns.map(|(index, _)| self.beam_end_in_base(index)).collect()
    }

    /// Where beam `index` ends, in the frame of the robot's base; no place if it did not return.
    #[must_use]
    pub fn beam_end_in_base(&self, index: usize) -> Point2 {
        self.end_in_base(index, f64::from(self.ranges_m[index]))
    }

    /// What a robot must not drive into, in the frame of its base: the ends of the beams that
    /// returned and, at the least range, those of the beams that met something nearer. The latter
    /// are no measurements, so nothing is matched to them.
    #[must_use]
    pub fn obstacles_in_base(&self) -> Vec<Point2> {
        let mut obstacles = self.points_in_base();
        let near = self.ranges_m.iter().enumerate().filter(|&(_, &range)| self.is_too_near(range));
        obstacles.extend(near.map(|(index, _)| self.end_in_base(index, self.range_min_m)));
        obstacles
    }

    fn end_in_base(&self, index: usize, range_m: f64) -> Point2 {
        let (sin, cos) = self.angle(index).sin_cos();
        self.base_from_sensor * Point2::new(range_m * cos, range_m * sin)
    }

    /// What a scanner in the middle of the robot says that sees from 0.1 m to 7 m, with beams
    /// evenly all round: `range_m` is how long each is, metres, given its cosine and sine; infinity
    /// if it meets nothing. For rooms with known geometry.
    #[must_use]
    pub fn all_round(beams: u32, range_m: impl Fn(f64, f64) -> f64) -> Self {
        let angle_increment = std::f64::consts::TAU / f64::from(beams);
        let ranges_m = (0..beams).map(|beam| {
            let (sin, cos) = (f64::from(beam) * angle_increment).sin_cos();
            range_m(cos, sin) as f32
        });
        Self {
            base_from_sensor: Pose2::identity(),
            angle_min: 0.0,
            angle_increment,
            range_min_m: 0.1,
            range_max_m: 7.0,
            ranges_m: ranges_m.collect(),
        }
    }

    /// The scan as a main node keeps it: ranges rounded to [`ScanRecord::STEP_MM`].
    #[must_use]
    pub fn to_record(&self) -> ScanRecord {
        let step_mm = f64::from(ScanRecord::STEP_MM);
        let to_mm = |&range: &f32| {
            let mm = (f64::from(range) * 1000.0 / step_mm).round() * step_mm;
            if self.is_return(range) && mm <= f64::from(u16::MAX) { mm as u16 } else { 0 }
        };
        ScanRecord {
            base_from_sensor: to_fixed(&self.base_from_sensor),
            angle_min: self.angle_min as f32,
            angle_increment: self.angle_increment as f32,
            ranges_mm: self.ranges_m.iter().map(to_mm).collect(),
        }
    }

    /// A scan that travelled. What did not return says nothing: whether it met nothing or something
    /// too near is not told.
    #[must_use]
    pub fn from_record(record: &ScanRecord) -> Self {
        let range = |&mm: &u16| if mm > 0 { f32::from(mm) / 1000.0 } else { f32::NAN };
        Self {
            base_from_sensor: from_fixed(record.base_from_sensor),
            angle_min: f64::from(record.angle_min),
            angle_increment: f64::from(record.angle_increment),
            range_min_m: 0.0,
            range_max_m: f64::from(u16::MAX) / 1000.0 + 1.0,
            ranges_m: record.ranges_mm.iter().map(range).collect(),
        }
    }

    /// End points of a scan that travelled, in the frame of the base of the robot that took it.
    #[must_use]
    pub fn record_points_in_base(record: &ScanRecord) -> Vec<Point2> {
        let base_from_sensor = from_fixed(record.base_from_sensor);
        let returns = record.ranges_mm.iter().enumerate().filter(|&(_, &mm)| mm > 0);
        returns
            .map(|(index, &mm)| {
                let angle = f64::from(record.angle_min) + index as f64 * f64::from(record.angle_increment);
                let range = f64::from(mm) / 1000.0;
                base_from_sensor * Point2::new(range * angle.cos(), range * angle.sin())
            })
            .collect()
    }
}

/// Four pinhole views of 90° × 90° that together are one seamless panorama: ahead, left, behind,
/// right (yaw 0, 90, 180, 270° in the base frame). All views are square and of one size. Pixel (0,
/// 0) is top left; columns run to the right.
#[derive(Clone, Debug)]
pub struct Panorama {
    /// Ahead, left, behind, right.
    pub views: [RgbImage; 4],
}

/// What the robot's sensors said at one instant. Scan and panorama were taken at `odom_from_base`.
#[derive(Clone, Debug)]
pub struct SensorFrame {
    /// Time since an epoch of the source's choosing, microseconds. Never goes back within one run.
    pub time_us: u64,
    /// Wheel odometry; it drifts.
    pub odom_from_base: Pose2,
    /// The laser scan.
    pub scan: LaserScan,
    /// The cameras' pictures, when they took one at this instant (cameras are slower than the
    /// LiDAR).
    pub panorama: Option<Panorama>,
}

/// A frame that nothing can be made of: taken in, it would turn every later pose into nonsense.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// The odometry is not a place.
    #[error("the odometry says x {x} m, y {y} m, yaw {yaw} rad")]
    Odometry {
        /// Metres.
        x: f64,
        /// Metres.
        y: f64,
        /// Radians.
        yaw: f64,
    },
    /// The lever arm of the scanner is not a pose.
    #[error("the scanner is mounted at x {x} m, y {y} m, yaw {yaw} rad")]
    Mount {
        /// Metres.
        x: f64,
        /// Metres.
        y: f64,
        /// Radians.
        yaw: f64,
    },
    /// The beams look nowhere.
    #[error("the scan begins at {angle_min} rad and goes on by {angle_increment} rad a beam")]
    Angles {
        /// Radians.
        angle_min: f64,
        /// Radians.
        angle_increment: f64,
    },
    /// The ranges have no limits.
    #[error("the scanner measures from {range_min_m} m to {range_max_m} m")]
    Limits {
        /// Metres.
        range_min_m: f64,
        /// Metres.
        range_max_m: f64,
    },
}

/// Farthest place that odometry may name, metres.
const MAX_PLACE_M: f64 = 1e6;
/// Longest range of a scanner, metres.
const MAX_RANGE_M: f64 = 1000.0;

/// x, y and yaw of a pose that is none.
fn nonsense(pose: &Pose2) -> Option<(f64, f64, f64)> {
    let (x, y, yaw) = (pose.translation.x, pose.translation.y, pose.rotation.angle());
    // A rotation that is not a unit number scales, and its angle may still be finite.
    let is_rotation = (pose.rotation.complex().norm() - 1.0).abs() < 1e-3;
    let is_pose = x.abs() <= MAX_PLACE_M && y.abs() <= MAX_PLACE_M && yaw.is_finite() && is_rotation;
    (!is_pose).then_some((x, y, yaw))
}

impl SensorFrame {
    /// Checks what every part of a robot relies on: a finite pose, and beams with finite angles and
    /// limits. Single ranges may be anything (see [`LaserScan::ranges_m`]). That time does not go
    /// back is for the caller, who knows the frame before.
    ///
    /// # Errors
    /// [`FrameError`], with the values.
    pub fn check(&self) -> Result<(), FrameError> {
        if let Some((x, y, yaw)) = nonsense(&self.odom_from_base) {
            return Err(FrameError::Odometry { x, y, yaw });
        }
        let &LaserScan { angle_min, angle_increment, range_min_m, range_max_m, .. } = &self.scan;
        if let Some((x, y, yaw)) = nonsense(&self.scan.base_from_sensor) {
            return Err(FrameError::Mount { x, y, yaw });
        }
        let is_angle = |angle: f64| angle.abs() <= 2.0 * std::f64::consts::TAU;
        if !is_angle(angle_min) || !is_angle(angle_increment) {
            return Err(FrameError::Angles { angle_min, angle_increment });
        }
        if !(range_min_m >= 0.0 && range_min_m < range_max_m && range_max_m <= MAX_RANGE_M) {
            return Err(FrameError::Limits { range_min_m, range_max_m });
        }
        Ok(())
    }
}

/// What the robot is told to do: forward speed and turning rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Metres per second along the base's x.
    pub linear_mps: f64,
    /// Radians per second, counter-clockwise.
    pub angular_radps: f64,
}

impl Twist {
    /// The same curve, driven at most so fast, metres per second forward or backward.
    #[must_use]
    pub fn limited(self, limit_mps: f64) -> Self {
        let speed_mps = self.linear_mps.abs();
        if limit_mps < speed_mps {
            let share = limit_mps / speed_mps;
            Self { linear_mps: self.linear_mps * share, angular_radps: self.angular_radps * share }
        } else {
            self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::pose;

    fn frame() -> SensorFrame {
        let scan = LaserScan {
            base_from_sensor: pose(0.0, 0.0, 0.0),
            angle_min: -3.0,
            angle_increment: 0.1,
            range_min_m: 0.1,
            range_max_m: 7.0,
            ranges_m: vec![1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0],
        };
        SensorFrame { time_us: 0, odom_from_base: pose(1.0, 2.0, 0.5), scan, panorama: None }
    }

    #[test]
    fn a_limited_command_is_slower_along_the_same_curve() {
        let command = Twist { linear_mps: -0.5, angular_radps: 1.0 };
        assert_eq!(command.limited(0.25), Twist { linear_mps: -0.25, angular_radps: 0.5 });
        assert_eq!(command.limited(0.5), command);
        let turn = Twist { linear_mps: 0.0, angular_radps: 1.0 };
        assert_eq!(turn.limited(0.1), turn);
    }

    #[test]
    fn frames_that_nothing_can_be_made_of_are_told_from_others() {
        assert_eq!(frame().check(), Ok(()));
        for bad in [f64::NAN, f64::INFINITY, 1e300] {
            for odom_from_base in [pose(bad, 0.0, 0.0), pose(0.0, bad, 0.0)] {
                let error = SensorFrame { odom_from_base, ..frame() }.check();
                assert!(matches!(error, Err(FrameError::Odometry { .. })), "{bad}: {error:?}");
            }
            let with = |scan| SensorFrame { scan, ..frame() }.check();
            let mount = with(LaserScan { base_from_sensor: pose(bad, 0.0, 0.0), ..frame().scan });
            assert!(matches!(mount, Err(FrameError::Mount { .. })));
            let angles = with(LaserScan { angle_increment: bad, ..frame().scan });
            assert!(matches!(angles, Err(FrameError::Angles { .. })));
            let limits = with(LaserScan { range_max_m: bad, ..frame().scan });
            assert!(matches!(limits, Err(FrameError::Limits { .. })));
        }
        let odom_from_base = pose(0.0, 0.0, f64::NAN);
        assert!(SensorFrame { odom_from_base, ..frame() }.check().is_err());
    }
}
