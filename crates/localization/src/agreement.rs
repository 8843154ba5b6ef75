//! Which estimations of one drive agree with each other (paper, section III-C-1).
//!
//! Two estimations agree when the motion between them on the map is the motion that the odometry
//! measured, within what scan matching and drift explain.

use crate::estimate::PlaceEstimate;
use fht_perception::consensus::{ConsensusConfig, MOST_VERTICES};
use fht_perception::drift::{OdometryDrift, propagate};
use fht_perception::pose::Pose2;

/// Whether two estimations are explained by one and the same place of the odometry frame on the
/// map.
#[must_use]
pub fn agree(a: &PlaceEstimate, b: &PlaceEstimate, noise: &OdometryDrift, config: &ConsensusConfig) -> bool {
    let predicted: Pose2 = a.map_from_base * (a.odom_from_base.inverse() * b.odom_from_base);
    if !config.is_near(&predicted, &b.map_from_base) {
        return false;
    }
    let driven = (b.odometer_m - a.odometer_m).abs();
    let turned = (b.turned_rad - a.turned_rad).abs();
    let covariance = propagate(&a.covariance, &a.map_from_base, &predicted, noise, driven, turned) + b.covariance;
    config.explains(&predicted, &b.map_from_base, &covariance)
}

/// Which of the first [`MOST_VERTICES`] estimations agree pairwise: bit `j` of entry `i` says so of
/// `i` and `j`.
#[must_use]
pub fn agreement_graph(estimates: &[PlaceEstimate], noise: &OdometryDrift, config: &ConsensusConfig) -> Vec<u64> {
    let count = estimates.len().min(MOST_VERTICES);
    let mut graph = vec![0_u64; count];
    for i in 0..count {
        for j in 0..i {
            if agree(&estimates[j], &estimates[i], noise, config) {
                graph[i] |= 1 << j;
                graph[j] |= 1 << i;
            }
        }
    }
    graph
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::consensus::{heaviest_clique, members};
    use fht_perception::pose::pose;
    use nalgebra::{Matrix3, Vector3};

    fn estimate(map_from_odom: &Pose2, odom_from_base: Pose2, odometer_m: f64) -> PlaceEstimate {
        PlaceEstimate {
            map_from_base: map_from_odom * odom_from_base,
            covariance: Matrix3::from_diagonal(&Vector3::new(4e-4, 4e-4, 1e-4)),
            odom_from_base,
            odometer_m,
            turned_rad: 0.0,
            score: 0.9,
        }
    }

    #[test]
    fn estimations_across_the_angle_wrap_agree() {
        let (noise, config) = (OdometryDrift::default(), ConsensusConfig::default());
        let a = estimate(&pose(1.0, 2.0, 3.13), pose(0.0, 0.0, 0.0), 0.0);
        let b = estimate(&pose(1.0, 2.0, -3.13), pose(1.0, 0.0, 0.1), 1.0);
        assert!(agree(&a, &b, &noise, &config));
        let c = estimate(&pose(1.0, 2.0, 2.83), pose(1.0, 0.0, 0.1), 1.0);
        assert!(!agree(&a, &c, &noise, &config));
    }

    #[test]
    fn the_larger_set_that_agrees_wins_over_better_scores_that_do_not() {
        let (noise, config) = (OdometryDrift::default(), ConsensusConfig::default());
        let truth = pose(3.0, -4.0, 2.0);
        let mut estimates: Vec<PlaceEstimate> =
            (0..5).map(|k| estimate(&truth, pose(f64::from(k), 0.0, 0.0), f64::from(k))).collect();
        estimates.insert(1, estimate(&pose(9.0, 9.0, 0.0), pose(0.5, 0.0, 0.0), 0.5));
        estimates.insert(3, estimate(&pose(-9.0, 1.0, 0.0), pose(1.5, 0.0, 0.0), 1.5));
        let graph = agreement_graph(&estimates, &noise, &config);
        let weights = [0.6, 1.0, 0.6, 1.0, 0.6, 0.6, 0.6];
        assert_eq!(members(heaviest_clique(&graph, &weights, u64::MAX)).collect::<Vec<_>>(), [0, 2, 4, 5, 6]);
    }
}
