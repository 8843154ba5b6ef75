//! What SLAM says: where things are, and how well that is known.

use fht_perception::frame::LaserScan;
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Point2, Pose2};
use nalgebra::Matrix3;
use std::sync::Arc;

/// A pose that follows a keyframe when that is moved.
#[derive(Clone, Copy, Debug)]
pub struct Anchored {
    /// Index of the keyframe.
    pub keyframe: usize,
    /// Pose in its frame.
    pub keyframe_from_base: Pose2,
}

/// A scan that the grid shows.
#[derive(Clone, Debug)]
pub struct GridScan {
    /// Where it was taken.
    pub anchored: Anchored,
    /// The scan.
    pub scan: Arc<LaserScan>,
}

/// What is known by now: the grid, and where the keyframes are.
#[derive(Clone, Copy)]
pub struct SlamEstimate<'a> {
    /// The occupancy grid, in the map frame.
    pub grid: &'a OccupancyGrid,
    /// Poses of the keyframes in the map frame.
    pub poses: &'a [Pose2],
}

impl SlamEstimate<'_> {
    /// Where something is in the map.
    #[must_use]
    pub fn locate(&self, anchored: &Anchored) -> Pose2 {
        locate(self.poses, anchored)
    }

    /// A pose in the map, tied to the nearest keyframe; to the map frame itself if there is none.
    #[must_use]
    pub fn anchor(&self, map_from_thing: &Pose2) -> Anchored {
        let apart = |pose: &Pose2| (pose.translation.vector - map_from_thing.translation.vector).norm_squared();
        let nearest = self.poses.iter().enumerate().min_by(|(_, a), (_, b)| apart(a).total_cmp(&apart(b)));
        let (keyframe, map_from_keyframe) =
            nearest.map_or((0, Pose2::identity()), |(keyframe, pose)| (keyframe, *pose));
        Anchored { keyframe, keyframe_from_base: map_from_keyframe.inverse() * map_from_thing }
    }
}

/// How well the robot knows where it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tracking {
    /// Scans fit.
    #[default]
    Matched,
    /// The scan shows too little to be matched, or did not fit for a moment: the wheels are
    /// believed.
    Wheels,
    /// Scans have contradicted the map for a while: nothing is mapped until the robot is found
    /// again.
    Lost,
}

/// The estimate after one frame.
#[derive(Clone, Debug)]
pub struct SlamUpdate {
    /// Where the robot is.
    pub map_from_base: Pose2,
    /// The same, relative to a keyframe.
    pub anchored: Anchored,
    /// Covariance of x, y (metres, submap frame) and yaw (radians), relative to the submap.
    pub covariance: Matrix3<f64>,
    /// Share of the scan that the submap explains; 0 when the wheels alone were used.
    pub score: f64,
    /// How well the pose is known.
    pub tracking: Tracking,
    /// Whether earlier keyframes were moved.
    pub is_corrected: bool,
}

/// Where something is in the map.
pub(super) fn locate(poses: &[Pose2], anchored: &Anchored) -> Pose2 {
    poses.get(anchored.keyframe).copied().unwrap_or_else(Pose2::identity) * anchored.keyframe_from_base
}

/// What a robot sees that does not know where it is.
#[derive(Clone, Debug)]
pub struct Lost {
    /// Wall points in its frame.
    pub points: Vec<Point2>,
    /// What the wheels said there.
    pub odom_from_base: Pose2,
}
