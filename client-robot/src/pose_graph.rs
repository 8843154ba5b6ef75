//! Pose-graph optimisation over accepted estimations (paper, section III-C-1, with wrapped angles).
//!
//! A chain of robot poses in the map frame, joined by odometry; estimations hold some of them to the map. Gauss-Newton
//! with iteratively reweighted estimations (Cauchy), so that one bad estimation bends nothing.

use crate::estimate::difference;
use fht_robot::pose::{Pose2, pose, wrap_angle};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Vector3};

/// What holds one pose of the chain to the map.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Which pose of the chain.
    pub index: usize,
    /// Where it was measured to be, map frame.
    pub map_from_base: Pose2,
    /// Covariance: x and y (m) in the map frame, yaw (rad).
    pub covariance: Matrix3<f64>,
}

/// What odometry says of the way from one pose of the chain to the next.
#[derive(Clone, Debug)]
pub struct Step {
    /// The next base in the frame of this one.
    pub relative: Pose2,
    /// Standard deviation of its position, metres (positive).
    pub sigma_m: f64,
    /// Standard deviation of its heading, radians (positive).
    pub sigma_rad: f64,
}

/// How the optimisation runs.
#[derive(Clone, Debug)]
pub struct PoseGraphConfig {
    /// Most iterations. Default 20.
    pub iterations: usize,
    /// Stops when no pose moves more than this (metres or radians). Default 1e-6.
    pub tolerance: f64,
    /// Mahalanobis distance at which an estimation counts half (Cauchy). Default 3.
    pub robust_scale: f64,
}

impl Default for PoseGraphConfig {
    fn default() -> Self {
        Self { iterations: 20, tolerance: 1e-6, robust_scale: 3.0 }
    }
}

/// The optimum.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The chain in the map frame.
    pub poses: Vec<Pose2>,
    /// Covariance of the last pose: x and y (m) in the map frame, yaw (rad).
    pub last_covariance: Matrix3<f64>,
    /// Weighted mean of the squared Mahalanobis distances of the priors; about 3 or less when all is well.
    pub mean_squared_error: f64,
}

/// Optimises a chain of `steps.len() + 1` poses. `None` if there is no prior, an index is out of range, a covariance is
/// not positive, or the numbers run away.
#[must_use]
pub fn optimise(priors: &[Prior], steps: &[Step], config: &PoseGraphConfig) -> Option<Solution> {
    let count = steps.len() + 1;
    let information: Vec<Matrix3<f64>> = priors
        .iter()
        .map(|prior| if prior.index < count { prior.covariance.try_inverse() } else { None })
        .collect::<Option<_>>()?;
    if steps.iter().any(|step| !(step.sigma_m > 0.0 && step.sigma_rad > 0.0)) {
        return None;
    }
    let mut poses = initial_chain(priors, steps)?;
    for _ in 0..config.iterations {
        let (hessian, gradient) = linearise(&poses, priors, &information, steps, config);
        let change = hessian.cholesky()?.solve(&-gradient);
        if !change.iter().all(|value| value.is_finite()) {
            return None;
        }
        for (index, at) in poses.iter_mut().enumerate() {
            let by = change.fixed_rows::<3>(3 * index);
            let yaw = wrap_angle(at.rotation.angle() + by[2]);
            *at = pose(at.translation.x + by[0], at.translation.y + by[1], yaw);
        }
        if change.amax() < config.tolerance {
            break;
        }
    }
    let (hessian, _) = linearise(&poses, priors, &information, steps, config);
    let inverse = hessian.cholesky()?.inverse();
    let last_covariance = inverse.fixed_view::<3, 3>(3 * (count - 1), 3 * (count - 1)).into_owned();
    let errors = priors.iter().zip(&information).map(|(prior, info)| {
        let squared = squared_distance(&poses[prior.index], prior, info);
        (cauchy_weight(squared, config), squared)
    });
    let (weights, sum) = errors.fold((0.0, 0.0), |(w, s), (weight, squared)| (w + weight, s + weight * squared));
    Some(Solution { poses, last_covariance, mean_squared_error: sum / weights.max(f64::MIN_POSITIVE) })
}

/// Starts from the surest prior and follows the odometry both ways.
fn initial_chain(priors: &[Prior], steps: &[Step]) -> Option<Vec<Pose2>> {
    let spread = |prior: &Prior| prior.covariance.trace();
    let anchor = priors.iter().min_by(|a, b| spread(a).total_cmp(&spread(b)))?;
    let mut poses = vec![anchor.map_from_base; steps.len() + 1];
    for k in anchor.index..steps.len() {
        poses[k + 1] = poses[k] * steps[k].relative;
    }
    for k in (0..anchor.index).rev() {
        poses[k] = poses[k + 1] * steps[k].relative.inverse();
    }
    Some(poses)
}

fn squared_distance(at: &Pose2, prior: &Prior, information: &Matrix3<f64>) -> f64 {
    let residual = difference(at, &prior.map_from_base);
    residual.dot(&(information * residual))
}

fn cauchy_weight(squared: f64, config: &PoseGraphConfig) -> f64 {
    1.0 / (1.0 + squared / (config.robust_scale * config.robust_scale))
}

fn linearise(
    poses: &[Pose2],
    priors: &[Prior],
    information: &[Matrix3<f64>],
    steps: &[Step],
    config: &PoseGraphConfig,
) -> (DMatrix<f64>, DVector<f64>) {
    let size = 3 * poses.len();
    let mut hessian = DMatrix::zeros(size, size);
    let mut gradient = DVector::zeros(size);
    for (prior, info) in priors.iter().zip(information) {
        let residual = difference(&poses[prior.index], &prior.map_from_base);
        let weighted = info * cauchy_weight(residual.dot(&(info * residual)), config);
        let at = 3 * prior.index;
        let mut block = hessian.fixed_view_mut::<3, 3>(at, at);
        block += weighted;
        let mut rows = gradient.fixed_rows_mut::<3>(at);
        rows += weighted * residual;
    }
    for (k, step) in steps.iter().enumerate() {
        let (from, to) = (&poses[k], &poses[k + 1]);
        let inverse_rotation: Matrix2<f64> = from.rotation.to_rotation_matrix().into_inner().transpose();
        let moved = to.translation.vector - from.translation.vector;
        let seen = inverse_rotation * moved;
        let off = seen - step.relative.translation.vector;
        let turn = to.rotation.angle() - from.rotation.angle() - step.relative.rotation.angle();
        let residual = Vector3::new(off.x, off.y, wrap_angle(turn));
        // d(Rᵀ moved)/d yaw = -Rᵀ S moved with S the quarter turn; in the body frame that is (seen.y, -seen.x).
        let r = inverse_rotation;
        let by_from = Matrix3::new(-r.m11, -r.m12, seen.y, -r.m21, -r.m22, -seen.x, 0.0, 0.0, -1.0);
        let by_to = Matrix3::new(r.m11, r.m12, 0.0, r.m21, r.m22, 0.0, 0.0, 0.0, 1.0);
        let (w_m, w_rad) = (step.sigma_m.powi(-2), step.sigma_rad.powi(-2));
        let weight = Matrix3::from_diagonal(&Vector3::new(w_m, w_m, w_rad));
        let (i, j) = (3 * k, 3 * (k + 1));
        for (row, by_row) in [(i, &by_from), (j, &by_to)] {
            for (column, by_column) in [(i, &by_from), (j, &by_to)] {
                let mut block = hessian.fixed_view_mut::<3, 3>(row, column);
                block += by_row.transpose() * weight * by_column;
            }
            let mut rows = gradient.fixed_rows_mut::<3>(row);
            rows += by_row.transpose() * weight * residual;
        }
    }
    (hessian, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn small() -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 1e-5))
    }

    fn step(relative: Pose2) -> Step {
        Step { relative, sigma_m: 0.02, sigma_rad: 0.01 }
    }

    #[test]
    fn angles_on_both_sides_of_pi_average_to_pi_and_not_to_zero() {
        let priors =
            [3.139, -3.139].map(|yaw| Prior { index: 0, map_from_base: pose(1.0, 2.0, yaw), covariance: small() });
        let solution = optimise(&priors, &[], &PoseGraphConfig::default()).expect("two priors");
        assert!((solution.poses[0].rotation.angle().abs() - std::f64::consts::PI).abs() < 1e-6);
    }

    #[test]
    fn one_bad_estimation_bends_little() {
        let mut priors: Vec<Prior> =
            (0..5).map(|k| Prior { index: k, map_from_base: pose(k as f64, 0.0, 0.0), covariance: small() }).collect();
        priors[2].map_from_base = pose(2.6, 0.4, 0.2);
        let steps = vec![step(pose(1.0, 0.0, 0.0)); 4];
        let solution = optimise(&priors, &steps, &PoseGraphConfig::default()).expect("a chain");
        let error = difference(&solution.poses[4], &pose(4.0, 0.0, 0.0));
        assert!(error.norm() < 0.01, "{error}");
    }

    #[test]
    fn nothing_to_hold_on_to_is_no_solution() {
        assert!(optimise(&[], &[step(pose(1.0, 0.0, 0.0))], &PoseGraphConfig::default()).is_none());
        let prior = Prior { index: 3, map_from_base: pose(0.0, 0.0, 0.0), covariance: small() };
        assert!(optimise(&[prior], &[], &PoseGraphConfig::default()).is_none());
    }

    proptest! {
        #[test]
        fn exact_measurements_give_the_exact_chain(x in -50.0..50.0_f64, y in -50.0..50.0_f64, yaw in -3.2..3.2_f64,
                                                    turns in proptest::collection::vec(-3.0..3.0_f64, 1..8)) {
            let mut truth = vec![pose(x, y, yaw)];
            let steps: Vec<Step> = turns.iter().map(|&turn| step(pose(0.8, 0.1, turn))).collect();
            for step in &steps {
                truth.push(truth[truth.len() - 1] * step.relative);
            }
            let last = truth.len() - 1;
            let priors = [0, last].map(|index| Prior { index, map_from_base: truth[index], covariance: small() });
            let solution = optimise(&priors, &steps, &PoseGraphConfig::default()).expect("a chain");
            for (found, true_pose) in solution.poses.iter().zip(&truth) {
                prop_assert!(difference(found, true_pose).norm() < 1e-6);
            }
            prop_assert!(solution.mean_squared_error < 1e-6);
        }
    }
}
