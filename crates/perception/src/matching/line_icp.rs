//! Robust point-to-line refinement with the covariance of its solution.

use super::{MatchConfig, ReferenceCloud, ScanMatch, SeenPoint};
use crate::pose::{Point2, Pose2, pose, wrap_angle};
use nalgebra::{Matrix3, Vector3};

/// What was known of the pose before the scans were compared (odometry): a Gaussian.
#[derive(Clone, Debug)]
pub struct Prior {
    /// Its mean.
    pub reference_from_moving: Pose2,
    /// Inverse of its covariance over x, y (metres, reference frame) and yaw (radians).
    pub information: Matrix3<f64>,
}

/// Aligns `moving`, a scan seen from its frame's origin, with `reference`, starting at `guess`.
/// `None` if too few points find a partner or the geometry does not fix the pose at all.
#[must_use]
pub fn refine(reference: &ReferenceCloud, moving: &[Point2], guess: &Pose2, config: &MatchConfig) -> Option<ScanMatch> {
    // A weak prior (10 m, 3 rad) keeps the system solvable in a corridor; the covariance then says
    // what is not known.
    let information = Matrix3::from_diagonal(&Vector3::new(1e-2, 1e-2, 1e-1));
    refine_with_prior(reference, moving, &Prior { reference_from_moving: *guess, information }, config)
}

/// Aligns `moving` with `reference`, starting at the prior's mean and held by it where the geometry
/// is silent: the maximum a-posteriori pose.
#[must_use]
pub fn refine_with_prior(
    reference: &ReferenceCloud,
    moving: &[Point2],
    prior: &Prior,
    config: &MatchConfig,
) -> Option<ScanMatch> {
    if moving.len() < config.min_points || reference.len() < config.min_points {
        return None;
    }
    let mut estimate = prior.reference_from_moving;
    let mut information = Matrix3::zeros();
    let seen: Vec<SeenPoint> = moving.iter().copied().map(SeenPoint::of_scan).collect();
    for iteration in 0..config.max_iterations {
        let progress = (iteration as f64 / (config.max_iterations as f64 * 0.5)).min(1.0);
        let reach = config.first_reach_m * (config.last_reach_m / config.first_reach_m).powf(progress);
        let system = linearise(reference, &seen, &estimate, reach, config);
        if system.partners < config.min_points / 2 {
            return None;
        }
        information = system.information + prior.information;
        let gradient = system.gradient + prior.information * difference(&estimate, &prior.reference_from_moving);
        let step = -information.cholesky()?.solve(&gradient);
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        estimate =
            pose(estimate.translation.x + step.x, estimate.translation.y + step.y, estimate.rotation.angle() + step.z);
        if progress >= 1.0 && step.xy().norm() < 1e-4 && step.z.abs() < 1e-5 {
            break;
        }
    }
    let score = reference.explained_share(seen.into_iter(), &estimate, config.explained_m)?;
    Some(ScanMatch { reference_from_moving: estimate, covariance: information.try_inverse()?, score })
}

/// Components (x, y, wrapped yaw) of `a` less `b`.
fn difference(a: &Pose2, b: &Pose2) -> Vector3<f64> {
    let translation = a.translation.vector - b.translation.vector;
    Vector3::new(translation.x, translation.y, wrap_angle(a.rotation.angle() - b.rotation.angle()))
}

struct System {
    information: Matrix3<f64>,
    gradient: Vector3<f64>,
    partners: usize,
}

fn linearise(
    reference: &ReferenceCloud,
    moving: &[SeenPoint],
    estimate: &Pose2,
    reach: f64,
    config: &MatchConfig,
) -> System {
    let mut system = System { information: Matrix3::zeros(), gradient: Vector3::zeros(), partners: 0 };
    let variance = config.point_sigma_m * config.point_sigma_m;
    // Cauchy kernel: a point off by a third of the reach counts half.
    let softness = (reach / 3.0).max(2.0 * config.point_sigma_m);
    for point in moving {
        let rotated = estimate.rotation * point.position.coords;
        let seen = point.transformed(estimate);
        let moved = seen.position;
        let Some(partner) = reference.nearest(&seen, reach) else { continue };
        system.partners += 1;
        let Some(normal) = partner.normal else { continue };
        let residual = (moved - partner.position).dot(&normal);
        let weight = 1.0 / (variance * (1.0 + (residual / softness).powi(2)));
        let jacobian = Vector3::new(normal.x, normal.y, normal.y * rotated.x - normal.x * rotated.y);
        system.information += weight * jacobian * jacobian.transpose();
        system.gradient += weight * residual * jacobian;
    }
    discount_noise_of_normals(&mut system, config.normal_sigma_rad);
    system
}

/// Along a bare corridor nothing fixes the position, but normals are noisy, and each leans a little
/// along the wall: what they would tell of that direction is noise. The information of a direction
/// is made less by what noisy normals of the other direction would feign (compare Zhang et al., "On
/// degeneracy of optimization-based state estimation problems", ICRA 2016, who drop such directions
/// altogether).
fn discount_noise_of_normals(system: &mut System, normal_sigma_rad: f64) {
    let translation = system.information.fixed_view::<2, 2>(0, 0).into_owned().symmetric_eigen();
    let mut scale = Matrix3::identity();
    for (index, axis) in translation.eigenvectors.column_iter().enumerate() {
        let (here, other) = (translation.eigenvalues[index], translation.eigenvalues[1 - index]);
        if here <= 0.0 {
            continue;
        }
        let share = (1.0 - normal_sigma_rad * normal_sigma_rad * other / here).max(0.0).sqrt();
        let axis = Vector3::new(axis[0], axis[1], 0.0);
        scale -= (1.0 - share) * axis * axis.transpose();
    }
    system.information = scale * system.information * scale;
    system.gradient = scale * (scale * system.gradient);
}
