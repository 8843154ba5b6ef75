//! One estimation of where the robot is: a scan of it fitted there (paper, section III-C-1,
//! equation 9).

use fht_perception::pose::Pose2;
use nalgebra::Matrix3;

/// A single estimation: where the robot's base was in the map frame when the odometry said
/// `odom_from_base`.
#[derive(Clone, Debug)]
pub struct PlaceEstimate {
    /// Pose of the base in the map frame at that moment.
    pub map_from_base: Pose2,
    /// Covariance of `map_from_base`: x and y (m) in the map frame, yaw (rad).
    pub covariance: Matrix3<f64>,
    /// Pose of the base in the odometry frame at that moment.
    pub odom_from_base: Pose2,
    /// Distance driven until that moment, metres.
    pub odometer_m: f64,
    /// Turned (either way) until that moment, radians.
    pub turned_rad: f64,
    /// Score of the scan match, 0 to 1.
    pub score: f64,
}
