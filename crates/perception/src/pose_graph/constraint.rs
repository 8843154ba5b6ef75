//! An edge of a pose graph: what was measured between two poses, and how far they are from it.

use crate::pose::Pose2;
use nalgebra::{Matrix3, Vector3};

/// A measurement between two poses.
#[derive(Clone, Debug)]
pub struct PoseConstraint {
    /// Index of the pose in whose frame it was measured.
    pub from: usize,
    /// Index of the pose that was measured.
    pub to: usize,
    /// The pose of `to` in the frame of `from`.
    pub measured: Pose2,
    /// Inverse covariance of x, y (metres, frame of `from`) and yaw (radians).
    pub information: Matrix3<f64>,
    /// Whether it may be wrong altogether.
    pub is_doubtful: bool,
}

/// What an edge says is off, in the frame of its first pose: metres, metres, radians.
#[must_use]
pub fn residual(edge: &PoseConstraint, from: &Pose2, to: &Pose2) -> Vector3<f64> {
    let seen = from.inverse() * to;
    let translation = seen.translation.vector - edge.measured.translation.vector;
    Vector3::new(translation.x, translation.y, edge.measured.rotation.rotation_to(&seen.rotation).angle())
}

/// Squared Mahalanobis distance of an edge's residual.
#[must_use]
pub fn chi2(edge: &PoseConstraint, poses: &[Pose2]) -> f64 {
    let error = residual(edge, &poses[edge.from], &poses[edge.to]);
    error.dot(&(edge.information * error))
}

/// Weight of a doubtful edge with squared distance `chi2` under a kernel of squared width `width2`.
pub(super) fn geman_mcclure(chi2: f64, width2: f64) -> f64 {
    let share = width2 / (width2 + chi2);
    share * share
}
