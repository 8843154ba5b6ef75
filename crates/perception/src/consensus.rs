//! Outlier rejection: which estimations agree with each other (paper, section III-C-1). The
//! heaviest set of them that agree pairwise is a maximum clique.

use crate::drift::difference;
use crate::pose::Pose2;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// When two estimations agree.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ConsensusConfig {
    /// Greatest squared Mahalanobis distance. Default 16.27: 99.9 % of χ² with three degrees of
    /// freedom.
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

impl ConsensusConfig {
    /// Whether a pose that was found is where another one predicts it, whatever their covariances
    /// say.
    #[must_use]
    pub fn is_near(&self, predicted: &Pose2, found: &Pose2) -> bool {
        let gap = difference(predicted, found);
        gap.xy().norm() <= self.max_disagreement_m && gap.z.abs() <= self.max_disagreement_rad
    }

    /// Whether it is where the other one predicts it. `covariance` is that of the difference: of
    /// both together.
    #[must_use]
    pub fn explains(&self, predicted: &Pose2, found: &Pose2, covariance: &Matrix3<f64>) -> bool {
        let gap = difference(predicted, found);
        self.is_near(predicted, found)
            && covariance.cholesky().is_some_and(|factor| gap.dot(&factor.solve(&gap)) <= self.gate)
    }
}

/// Most vertices of a graph (sets of them are bit masks).
pub const MOST_VERTICES: usize = 64;

/// The clique of greatest weight among the vertices in `allowed`, as a bit mask (Bron and Kerbosch,
/// with pivots). Among equals the one found first wins, so the result is a pure function of the
/// input.
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
    use proptest::prelude::*;

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
