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

/// Where a robot may be now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PossiblePlace {
    /// Its pose in the map frame.
    pub map_from_base: Pose2,
    /// How probable that is, 0 to 1. Those of all places add up to 1 at most: it may be at none of
    /// them.
    pub probability: f64,
}
