//! Poses on the plane, and times, as messages.

use crate::yaw::{heading_of, quaternion_of};
use fht_perception::pose::Pose2;
use fht_ros_messages::msg::{HeaderMsg, Pose, Time, Vector3};

/// A plane pose as a message; REP-103 axes.
#[must_use]
pub fn pose_message(pose: &Pose2) -> Pose {
    Pose {
        position: Vector3 { x: pose.translation.x, y: pose.translation.y, z: 0.0 },
        orientation: quaternion_of(heading_of(&pose.rotation)),
    }
}

/// A header at `time_us` microseconds since the epoch.
#[must_use]
pub fn header_message(time_us: u64, frame_id: &str) -> HeaderMsg {
    HeaderMsg { stamp: Time::from_us(time_us), frame_id: frame_id.to_owned() }
}
