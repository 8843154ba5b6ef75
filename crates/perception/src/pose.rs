//! SE(2) poses. A name `a_from_b` transforms coordinates in frame `b` to frame `a`; frames are
//! REP-105's `map`, `odom` and `base` (base_link), and `sensor`.

use fht_proto::api::reply::{check_yaw, parse_angle};
use fht_proto::{FixedPoint, FixedPose};
use nalgebra::{Isometry2, Vector2};

/// A rigid transform of the plane: metres, radians.
pub type Pose2 = Isometry2<f64>;
/// A point of the plane, metres.
pub type Point2 = nalgebra::Point2<f64>;

/// The pose at (`x`, `y`) metres with heading `yaw` radians.
#[must_use]
pub fn pose(x: f64, y: f64, yaw: f64) -> Pose2 {
    Isometry2::new(Vector2::new(x, y), yaw)
}

/// The angle wrapped to (-π, π].
#[must_use]
pub fn wrap_angle(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// The point as it travels, rounded to 1 mm.
#[must_use]
pub fn fixed_point(point: Point2) -> FixedPoint {
    FixedPoint::from_metres(point.x, point.y)
}

/// The pose as it travels, rounded to 1 mm and 1e-4 rad.
#[must_use]
pub fn to_fixed(pose: &Pose2) -> FixedPose {
    FixedPose::from_metres(pose.translation.x, pose.translation.y, pose.rotation.angle())
}

/// A pose that travelled.
#[must_use]
pub fn from_fixed(fixed: FixedPose) -> Pose2 {
    pose(fixed.position.x(), fixed.position.y(), fixed.yaw())
}

/// Reads `x,y,yaw` or `x,y`: metres, and an angle as [`parse_angle`] reads it. People write poses
/// so; programs write radians, as `{x},{y},{yaw}rad`.
///
/// # Errors
/// A sentence with the text.
pub fn parse(text: &str) -> Result<Pose2, String> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    let parts: Vec<&str> = text.split(',').collect();
    let read = match *parts.as_slice() {
        [x, y, yaw] => number(x).zip(number(y)).zip(parse_angle(yaw)),
        [x, y] => number(x).zip(number(y)).zip(Some(0.0)),
        _ => None,
    };
    let wrong = || format!("'{text}' is not x,y,yaw in metres and degrees (or radians: 1.57rad)");
    let ((x, y), yaw_rad) = read.ok_or_else(wrong)?;
    Ok(pose(x, y, check_yaw(yaw_rad)?))
}
