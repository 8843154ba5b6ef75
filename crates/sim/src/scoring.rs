//! Scores against the truth: poses, trajectories, and the share of a building that is known.

pub(crate) mod truth;

use crate::plan::FloorPlan;
use fht_perception::grid::{CellState, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2, wrap_angle};
use serde::{Deserialize, Serialize};

/// Error of estimated poses.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct TrajectoryError {
    /// Mean error of the positions, metres.
    pub mean_m: f64,
    /// Largest error of the positions, metres.
    pub max_m: f64,
    /// Mean error of the headings, degrees.
    pub mean_deg: f64,
}

/// Distance (metres) and angle (degrees) between an estimate and the truth.
#[must_use]
pub fn pose_error(estimate: &Pose2, truth: &Pose2) -> (f64, f64) {
    let turn = wrap_angle(estimate.rotation.angle() - truth.rotation.angle());
    (estimate.translation.vector.metric_distance(&truth.translation.vector), turn.abs().to_degrees())
}

/// Error of estimated poses in the map frame against true poses in the world frame.
#[must_use]
pub fn trajectory_error(estimated: &[Pose2], truth: &[Pose2], world_from_map: &Pose2) -> TrajectoryError {
    let (mut sum_m, mut max_m, mut sum_rad) = (0.0, 0.0_f64, 0.0);
    for (estimate, truth) in estimated.iter().zip(truth) {
        let difference = (world_from_map * estimate).inverse() * truth;
        let metres = difference.translation.vector.norm();
        sum_m += metres;
        max_m = max_m.max(metres);
        sum_rad += wrap_angle(difference.rotation.angle()).abs();
    }
    let count = estimated.len().min(truth.len()).max(1) as f64;
    TrajectoryError { mean_m: sum_m / count, max_m, mean_deg: (sum_rad / count).to_degrees() }
}

/// The free area that a robot of radius `radius_m` (metres) can reach from the origin of the map
/// frame, square metres, and the share of it that is known in `grid` (map frame).
#[must_use]
pub fn explored(plan: &FloorPlan, grid: &OccupancyGrid, world_from_map: &Pose2, radius_m: f64) -> (f64, f64) {
    explored_by(plan, world_from_map, radius_m, |place| grid.state_at(place) != CellState::Unknown)
}

/// Like [`explored`], with `is_known` to say which places of the map frame are known.
#[must_use]
pub fn explored_by(
    plan: &FloorPlan,
    world_from_map: &Pose2,
    radius_m: f64,
    is_known: impl Fn(Point2) -> bool,
) -> (f64, f64) {
    let reachable = plan.reachable_free(Point2::from(world_from_map.translation.vector), radius_m);
    let map_from_world = world_from_map.inverse();
    let (mut total, mut known) = (0_usize, 0_usize);
    for row in 0..plan.height() {
        for column in (0..plan.width()).filter(|column| reachable.contains(*column, row)) {
            total += 1;
            known += usize::from(is_known(map_from_world * plan.centre_of(column, row)));
        }
    }
    (plan.area_m2(&reachable), known as f64 / total.max(1) as f64)
}
