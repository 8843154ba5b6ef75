//! Odometry as ROS 2 filters and controllers need it: with the velocity in the robot's frame, and
//! with how uncertain pose and velocity are.

use crate::odometry_uncertainty::{PoseUncertainty, SCALE_SIGMA};
use crate::plane::{header_message, pose_message};
use fht_perception::pose::{Pose2, wrap_angle};
use fht_ros_messages::msg::{Covariance, OdometryMsg, PoseWithCovariance, TwistWithCovariance, Vector3};

/// Least standard deviation of a speed along either axis, metres per second.
const SPEED_SIGMA_MPS: f64 = 0.02;
/// Least standard deviation of a turning rate, radians per second.
const TURN_SIGMA_RADPS: f64 = 0.02;
/// Variance of what nothing was measured of.
const UNKNOWN: f64 = 1e6;
/// Where x, y and yaw are among the six axes of a message.
const PLANE: [usize; 3] = [0, 1, 5];

/// Makes messages of poses, one after the other.
#[derive(Clone, Debug)]
pub struct OdometryMessages {
    odom_frame: String,
    base_frame: String,
    last: Option<(u64, Pose2)>,
    uncertainty: PoseUncertainty,
}

impl Default for OdometryMessages {
    /// In the frames of REP-105: `odom` and `base_link`.
    fn default() -> Self {
        Self::in_frames("odom", "base_link")
    }
}

impl OdometryMessages {
    /// Of poses of one frame in another.
    #[must_use]
    pub fn in_frames(odom_frame: &str, base_frame: &str) -> Self {
        Self {
            odom_frame: odom_frame.to_owned(),
            base_frame: base_frame.to_owned(),
            last: None,
            uncertainty: PoseUncertainty::default(),
        }
    }

    /// The message of a pose at `time_us`. Its velocity is that of the way since the pose before:
    /// on a circle's arc. At the first pose it is unknown. Its covariance grows with the way, as
    /// odometry is never corrected.
    #[must_use]
    pub fn next(&mut self, time_us: u64, odom_from_base: &Pose2) -> OdometryMsg {
        let before = self.last.replace((time_us, *odom_from_base));
        let since = before.and_then(|(before_us, before)| {
            let seconds = time_us.checked_sub(before_us).filter(|micros| *micros > 0)? as f64 * 1e-6;
            Some((before.inverse() * odom_from_base, seconds))
        });
        if let Some((_, before)) = &before {
            self.uncertainty.carry(before, odom_from_base);
        }
        OdometryMsg {
            header: header_message(time_us, &self.odom_frame),
            child_frame_id: self.base_frame.clone(),
            pose: PoseWithCovariance { pose: pose_message(odom_from_base), covariance: self.pose_covariance() },
            twist: since.map_or_else(unknown_twist, |(moved, seconds)| twist(&moved, seconds)),
        }
    }

    /// In the odometry's frame.
    fn pose_covariance(&self) -> Covariance {
        let known = self.uncertainty.covariance();
        let mut covariance = diagonal([0.0; 3]);
        for (row, axis) in PLANE.into_iter().enumerate() {
            for (column, other) in PLANE.into_iter().enumerate() {
                covariance[axis][other] = known[(row, column)];
            }
        }
        covariance
    }
}

/// The constant velocity that moves a robot so in this time: the logarithm of the motion.
fn twist(moved: &Pose2, seconds: f64) -> TwistWithCovariance {
    let half = wrap_angle(moved.rotation.angle()) / 2.0;
    // Half an angle over its tangent; near zero both are the same.
    let along = if half.abs() < 1e-6 { 1.0 } else { half / half.tan() };
    let (x, y) = (moved.translation.x, moved.translation.y);
    let linear = Vector3 { x: (along * x + half * y) / seconds, y: (along * y - half * x) / seconds, z: 0.0 };
    let angular = Vector3 { z: 2.0 * half / seconds, ..Vector3::default() };
    let speed = |mps: f64| SPEED_SIGMA_MPS.powi(2) + (SCALE_SIGMA * mps).powi(2);
    let turn = TURN_SIGMA_RADPS.powi(2) + (SCALE_SIGMA * angular.z).powi(2);
    TwistWithCovariance { linear, angular, covariance: diagonal([speed(linear.x), speed(linear.y), turn]) }
}

fn unknown_twist() -> TwistWithCovariance {
    TwistWithCovariance { covariance: diagonal([UNKNOWN; 3]), ..TwistWithCovariance::default() }
}

/// Variances of x, y and yaw; nothing is known of the rest.
fn diagonal([x, y, yaw]: [f64; 3]) -> Covariance {
    let mut covariance = Covariance::default();
    for (axis, variance) in [x, y, UNKNOWN, UNKNOWN, UNKNOWN, yaw].into_iter().enumerate() {
        covariance[axis][axis] = variance;
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;

    /// A robot at 0.4 m/s and 0.5 rad/s on its circle, from wherever.
    fn on_a_circle(begin: Pose2, seconds: f64) -> Pose2 {
        let (turned, radius_m) = (0.5 * seconds, 0.8);
        begin * pose(radius_m * turned.sin(), radius_m * (1.0 - turned.cos()), turned)
    }

    #[test]
    fn the_velocity_is_that_of_the_robot_in_its_own_frame() {
        let begin = pose(3.0, -2.0, 2.9);
        let mut messages = OdometryMessages::default();
        let first = messages.next(7_000_000, &begin).twist;
        assert_eq!((first.linear, first.angular), (Vector3::default(), Vector3::default()));
        assert!(first.covariance[0][0] >= UNKNOWN, "nothing was measured yet");
        for frame in 1..20 {
            let message = messages.next(7_000_000 + frame * 200_000, &on_a_circle(begin, 0.2 * frame as f64));
            let (linear, angular) = (message.twist.linear, message.twist.angular);
            assert!((linear.x - 0.4).abs() < 1e-9 && linear.y.abs() < 1e-9, "{linear:?}");
            assert!((angular.z - 0.5).abs() < 1e-9, "{angular:?}");
        }
        // Straight on, and standing.
        let mut messages = OdometryMessages::default();
        let at = |x: f64| pose(x, 0.0, 0.0);
        let speeds = [(0, 0.0), (100_000, 0.05), (200_000, 0.05), (200_000, 0.05)]
            .map(|(time_us, x)| messages.next(time_us, &at(x)).twist.linear.x);
        assert!(speeds.iter().zip([0.0, 0.5, 0.0, 0.0]).all(|(speed, wanted)| (speed - wanted).abs() < 1e-9));
    }

    #[test]
    fn what_is_not_measured_is_unknown_and_the_pose_becomes_less_certain() {
        let mut messages = OdometryMessages::default();
        let mut last: Option<Covariance> = None;
        for frame in 0..50_u64 {
            let message = messages.next(frame * 200_000, &on_a_circle(Pose2::identity(), 0.2 * frame as f64));
            let covariance = message.pose.covariance;
            for axes in [covariance, message.twist.covariance] {
                assert!((0..6).all(|axis| axes[axis][axis] > 0.0), "{axes:?}");
                assert!((2..5).all(|axis| axes[axis][axis] >= UNKNOWN), "z, roll and pitch");
            }
            if let Some(last) = last {
                assert!(covariance[5][5] > last[5][5], "the heading becomes less certain");
            }
            assert!((0..6).all(|row| (0..6).all(|column| covariance[row][column] == covariance[column][row])));
            assert!(frame == 0 || covariance[0][5] != 0.0, "a wrong heading leads aside");
            last = Some(covariance);
        }
        let last = last.unwrap_or_default();
        assert!((0.03..0.3).contains(&last[0][0].sqrt()), "after 4 m: {} m", last[0][0].sqrt());
        assert!((0.01..0.2).contains(&last[5][5].sqrt()), "after 5 rad: {} rad", last[5][5].sqrt());
    }
}
