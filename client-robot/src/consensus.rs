//! Outlier rejection: which estimations agree with each other (paper, section III-C-1).
//!
//! Two estimations agree when the motion between them on the map is the motion that the odometry measured, within what
//! scan matching and drift explain. The largest set of estimations that agree pairwise is a maximum clique.

use crate::estimate::{Estimate, OdometryNoise, difference, propagate};
use fht_robot::pose::Pose2;

/// When two estimations agree.
#[derive(Clone, Debug)]
pub struct ConsensusConfig {
    /// Greatest squared Mahalanobis distance. Default 16.27: 99.9 % of χ² with three degrees of freedom.
    pub gate: f64,
    /// Greatest disagreement whatever the covariances say, metres. Default 0.6.
    pub max_disagreement_m: f64,
    /// Greatest disagreement in heading, radians. Default 8°.
    pub max_disagreement_rad: f64,
}

impl Default for ConsensusConfig {
    fn default() -> Self {
        Self { gate: 16.27, max_disagreement_m: 0.6, max_disagreement_rad: 8.0_f64.to_radians() }
    }
}

/// Most estimations that are compared at once (their sets are bit masks).
pub const MAX_ESTIMATES: usize = 64;

/// Whether two estimations are explained by one and the same place of the odometry frame on the map.
#[must_use]
pub fn agree(a: &Estimate, b: &Estimate, noise: &OdometryNoise, config: &ConsensusConfig) -> bool {
    let predicted: Pose2 = a.map_from_base * (a.odom_from_base.inverse() * b.odom_from_base);
    let gap = difference(&predicted, &b.map_from_base);
    if gap.xy().norm() > config.max_disagreement_m || gap.z.abs() > config.max_disagreement_rad {
        return false;
    }
    let driven = (b.odometer_m - a.odometer_m).abs();
    let turned = (b.turned_rad - a.turned_rad).abs();
    let covariance = propagate(&a.covariance, &a.map_from_base, &predicted, noise, driven, turned) + b.covariance;
    covariance.cholesky().is_some_and(|factor| gap.dot(&factor.solve(&gap)) <= config.gate)
}

/// Which of the first [`MAX_ESTIMATES`] estimations agree pairwise: bit `j` of entry `i` says so of `i` and `j`.
#[must_use]
pub fn agreement_graph(estimates: &[Estimate], noise: &OdometryNoise, config: &ConsensusConfig) -> Vec<u64> {
    let count = estimates.len().min(MAX_ESTIMATES);
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

/// The clique of greatest weight among the vertices in `allowed`, as a bit mask (Bron and Kerbosch, with pivots).
/// Among equals the one found first wins, so the result is a pure function of the input.
#[must_use]
pub fn heaviest_clique(graph: &[u64], weights: &[f64], allowed: u64) -> u64 {
    let mut search = CliqueSearch { graph, weights, best: 0, best_weight: 0.0, steps_left: 200_000 };
    let all = if graph.len() >= 64 { u64::MAX } else { (1_u64 << graph.len()) - 1 };
    search.extend(0, allowed & all, 0);
    search.best
}

/// Sum of the weights of a set.
#[must_use]
pub fn weight_of(set: u64, weights: &[f64]) -> f64 {
    members(set).filter_map(|index| weights.get(index)).sum()
}

/// The members of a bit mask, ascending.
pub fn members(set: u64) -> impl Iterator<Item = usize> {
    (0..64).filter(move |index| set >> index & 1 == 1)
}

struct CliqueSearch<'a> {
    graph: &'a [u64],
    weights: &'a [f64],
    best: u64,
    best_weight: f64,
    /// Bounds the work on graphs made to be hard; a real one takes some hundred steps.
    steps_left: usize,
}

impl CliqueSearch<'_> {
    fn extend(&mut self, clique: u64, mut candidates: u64, mut excluded: u64) {
        if self.steps_left == 0 {
            return;
        }
        self.steps_left -= 1;
        let weight = weight_of(clique, self.weights);
        if weight > self.best_weight {
            (self.best, self.best_weight) = (clique, weight);
        }
        if weight + weight_of(candidates, self.weights) <= self.best_weight {
            return;
        }
        let pivot = members(candidates | excluded).max_by_key(|&v| ((self.graph[v] & candidates).count_ones(), 64 - v));
        let Some(pivot) = pivot else { return };
        for vertex in members(candidates & !self.graph[pivot]) {
            let neighbours = self.graph[vertex];
            self.extend(clique | 1 << vertex, candidates & neighbours, excluded & neighbours);
            candidates &= !(1 << vertex);
            excluded |= 1 << vertex;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_robot::pose::pose;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    fn estimate(map_from_odom: &Pose2, odom_from_base: Pose2, odometer_m: f64) -> Estimate {
        Estimate {
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
        let (noise, config) = (OdometryNoise::default(), ConsensusConfig::default());
        let a = estimate(&pose(1.0, 2.0, 3.13), pose(0.0, 0.0, 0.0), 0.0);
        let b = estimate(&pose(1.0, 2.0, -3.13), pose(1.0, 0.0, 0.1), 1.0);
        assert!(agree(&a, &b, &noise, &config));
        let c = estimate(&pose(1.0, 2.0, 2.83), pose(1.0, 0.0, 0.1), 1.0);
        assert!(!agree(&a, &c, &noise, &config));
    }

    #[test]
    fn the_larger_set_that_agrees_wins_over_better_scores_that_do_not() {
        let (noise, config) = (OdometryNoise::default(), ConsensusConfig::default());
        let truth = pose(3.0, -4.0, 2.0);
        let mut estimates: Vec<Estimate> =
            (0..5).map(|k| estimate(&truth, pose(f64::from(k), 0.0, 0.0), f64::from(k))).collect();
        estimates.insert(1, estimate(&pose(9.0, 9.0, 0.0), pose(0.5, 0.0, 0.0), 0.5));
        estimates.insert(3, estimate(&pose(-9.0, 1.0, 0.0), pose(1.5, 0.0, 0.0), 1.5));
        let graph = agreement_graph(&estimates, &noise, &config);
        let weights = [0.6, 1.0, 0.6, 1.0, 0.6, 0.6, 0.6];
        assert_eq!(members(heaviest_clique(&graph, &weights, u64::MAX)).collect::<Vec<_>>(), [0, 2, 4, 5, 6]);
    }

    proptest! {
        #[test]
        fn the_heaviest_clique_is_what_trying_all_sets_finds(bits in proptest::collection::vec(any::<bool>(), 45),
                                                              weights in proptest::collection::vec(0.1..1.0_f64, 10)) {
            let mut graph = vec![0_u64; 10];
            let pairs = (0..10_usize).flat_map(|i| (0..i).map(move |j| (i, j)));
            for ((i, j), _) in pairs.zip(bits).filter(|&(_, joined)| joined) {
                graph[i] |= 1 << j;
                graph[j] |= 1 << i;
            }
            let is_clique = |set: u64| members(set).all(|v| set & !graph[v] == 1 << v);
            let best = (0..1_u64 << 10).filter(|&set| is_clique(set)).map(|set| weight_of(set, &weights));
            let found = heaviest_clique(&graph, &weights, u64::MAX);
            prop_assert!(is_clique(found));
            prop_assert!((weight_of(found, &weights) - best.fold(0.0, f64::max)).abs() < 1e-9);
        }
    }
}
