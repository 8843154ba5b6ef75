//! Ways as ROS has them: controllers look for a dense path.

use fht_perception::pose::{Point2, Pose2, pose};
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::msg::{PathMsg, PoseStamped};
use std::time::{SystemTime, UNIX_EPOCH};

/// Distance between a path's poses, metres.
const STEP_M: f64 = 0.05;

/// A way through `points` in the map frame, stamped now; at its end the robot heads for
/// `goal_yaw`, else as it came.
pub(super) fn path_message(points: &[Point2], goal_yaw: Option<f64>) -> PathMsg {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let header = header_message(u64::try_from(since.as_micros()).unwrap_or(u64::MAX), "map");
    let stamped = |at: Pose2| PoseStamped { header: header.clone(), pose: pose_message(&at) };
    let poses = dense(points, goal_yaw).into_iter().map(stamped).collect();
    PathMsg { header, poses }
}

/// A pose every [`STEP_M`], each heading for the next.
fn dense(points: &[Point2], goal_yaw: Option<f64>) -> Vec<Pose2> {
    let mut poses = Vec::new();
    let mut yaw = 0.0;
    for pair in points.windows(2) {
        let (from, way) = (pair[0], pair[1] - pair[0]);
        let steps = (way.norm() / STEP_M).ceil().max(1.0) as usize;
        yaw = way.y.atan2(way.x);
        poses.extend((0..steps).map(|step| {
            let at = from + way * (step as f64 / steps as f64);
            pose(at.x, at.y, yaw)
        }));
    }
    poses.extend(points.last().map(|last| pose(last.x, last.y, goal_yaw.unwrap_or(yaw))));
    poses
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_dense_and_ends_with_the_goals_heading() {
        let points = [Point2::new(0.0, 0.0), Point2::new(1.0, 0.0), Point2::new(1.0, 0.5)];
        let poses = dense(&points, Some(3.0));
        assert_eq!(poses.len(), 31);
        let steps = poses.windows(2).map(|pair| (pair[1].translation.vector - pair[0].translation.vector).norm());
        assert!(steps.into_iter().all(|step| step < STEP_M + 1e-9));
        assert!((poses[25].rotation.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
        assert!((poses[30].rotation.angle() - 3.0).abs() < 1e-9);
        let as_it_came = dense(&points, None).pop().map(|last| last.rotation.angle());
        assert!(as_it_came.is_some_and(|yaw| (yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-9));
        assert_eq!(dense(&[], Some(1.0)), []);
    }
}
