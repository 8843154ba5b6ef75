//! A place where a robot may be, not yet told apart from others like it.

use crate::pose::Pose2;

/// A place where a robot may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Where the odometry frame lies on the map if the robot is there.
    pub map_from_odom: Pose2,
    /// How probable that is, 0 to 1; those of all candidates add up to 1.
    pub share: f64,
}
