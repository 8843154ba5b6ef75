//! Keyframes matched to submaps, and which matches are good enough.

use super::config::ClosureConfig;
use crate::slam::submap::{Submap, SubmapFit};
use fht_perception::matching::{ScanMatch, SearchWindow, alignments, refine};
use fht_perception::pose::{Point2, Pose2};
use fht_perception::pose_graph::PoseConstraint;
use nalgebra::{Matrix3, Vector3};

/// A submap that a keyframe could be matched to.
pub(super) struct Candidate {
    pub(super) submap: usize,
    /// Where the keyframe should be in it.
    pub(super) guess: Pose2,
    pub(super) window_m: f64,
    pub(super) window_rad: f64,
    pub(super) distance_m: f64,
}

/// Matches a keyframe, seen as `points`, to a submap within a candidate's window.
pub(super) fn match_within(
    submap: &Submap,
    keyframe: (usize, &[Point2]),
    candidate: &Candidate,
    config: &ClosureConfig,
) -> Option<PoseConstraint> {
    best_within(submap, keyframe, candidate, config).filter(|best| best.is_sure).map(|best| best.edge)
}

/// The best match of a keyframe within a window.
pub(super) struct BestMatch {
    pub(super) edge: PoseConstraint,
    /// Whether it is a closure for itself.
    pub(super) is_sure: bool,
}

/// The best match of a keyframe, seen as `points`, to a submap within a candidate's window; none if
/// it is not even doubtful.
pub(super) fn best_within(
    submap: &Submap,
    (index, points): (usize, &[Point2]),
    candidate: &Candidate,
    config: &ClosureConfig,
) -> Option<BestMatch> {
    let guess = candidate.guess;
    let aligned = if candidate.window_m <= config.refine_m {
        refine(submap.cloud(), points, &guess, &config.matching).into_iter().collect()
    } else {
        let window = SearchWindow {
            centre: guess,
            half_x_m: candidate.window_m,
            half_y_m: candidate.window_m,
            half_yaw_rad: candidate.window_rad,
        };
        alignments(submap.cloud(), points, &window, &config.matching)
    };
    let is_inside = |found: &ScanMatch| {
        let off = guess.inverse() * found.reference_from_moving;
        off.translation.vector.norm() <= 1.5 * candidate.window_m + 0.1
            && off.rotation.angle().abs() <= 1.5 * candidate.window_rad
    };
    let judged = aligned.into_iter().filter(is_inside).map(|found| judge(submap, points, found));
    let (found, verdict) = judged.max_by(|(_, a), (_, b)| a.balance().cmp(&b.balance()))?;
    let reaches = |agreement: f64, overlap: f64| verdict.agreement() >= agreement && verdict.overlap() >= overlap;
    let is_sure = reaches(config.min_agreement, config.min_overlap);
    if !is_sure && !reaches(config.doubtful_agreement, config.doubtful_overlap) {
        return None;
    }
    let information = with_floor(&found.covariance, config.floor_m, config.floor_rad)?;
    let measured = found.reference_from_moving;
    let edge = PoseConstraint { from: submap.first(), to: index, measured, information, is_doubtful: true };
    Some(BestMatch { edge, is_sure })
}

pub(super) fn judge(submap: &Submap, points: &[Point2], found: ScanMatch) -> (ScanMatch, SubmapFit) {
    let verdict = submap.judge(points, &found.reference_from_moving);
    (found, verdict)
}

/// Information of a match whose covariance is at least the floor; `None` if it is none: a graph
/// with a single edge that is not positive definite has no solution.
pub fn with_floor(covariance: &Matrix3<f64>, floor_m: f64, floor_rad: f64) -> Option<Matrix3<f64>> {
    let floor = Vector3::new(floor_m * floor_m, floor_m * floor_m, floor_rad * floor_rad);
    let information = (covariance + Matrix3::from_diagonal(&floor)).try_inverse()?;
    information.cholesky().is_some().then_some(information)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_covariance_becomes_no_edge() {
        let corridor = Matrix3::from_diagonal(&Vector3::new(1e4, 1e-6, 1e-8));
        let information = with_floor(&corridor, 0.01, 0.002).unwrap_or_else(Matrix3::zeros);
        assert!(information[(0, 0)] > 0.0 && information[(1, 1)] > 9e3, "{information}");
        let less_than_nothing = Matrix3::from_diagonal(&Vector3::new(-1e4, 1e-6, 1e-8));
        assert!(with_floor(&less_than_nothing, 0.01, 0.002).is_none());
    }
}
