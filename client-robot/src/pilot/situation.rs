//! Where the robot is at a frame, and where it goes.

use super::task::DriveGoal;
use fht_perception::pose::{Point2, Pose2};

/// Where the robot is at a frame, and where it goes.
#[derive(Clone, Copy)]
pub(super) struct Situation {
    pub(super) map_from_odom: Pose2,
    pub(super) odom_from_base: Pose2,
    pub(super) now_us: u64,
    pub(super) goal: DriveGoal,
    /// Where the path ends: elsewhere than the goal if it leads to the nearest point only.
    pub(super) end: Point2,
}

impl Situation {
    /// The robot's place, odometry frame.
    pub(super) fn here(&self) -> Point2 {
        Point2::from(self.odom_from_base.translation.vector)
    }

    pub(super) fn map_from_base(&self) -> Pose2 {
        self.map_from_odom * self.odom_from_base
    }
}
