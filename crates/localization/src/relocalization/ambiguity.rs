//! Which places all that was seen does not tell apart.

use super::RelocalizationConfig;
use crate::confidence::ConfidenceConfig;
use crate::hypotheses::{Hypothesis, is_near};
use crate::votes::{RivalConfig, Votes};
use fht_perception::candidate::Candidate;
use fht_perception::pose::Pose2;

/// The places of `hypotheses`, which have these votes, that are not clearly behind the one with
/// most pieces of wall right, most probable first.
pub(super) fn not_told_apart(
    hypotheses: &[Hypothesis],
    votes: &[Votes],
    odom_from_base: &Pose2,
    config: &RelocalizationConfig,
) -> Vec<Candidate> {
    let at = hypotheses.iter().map(Hypothesis::map_from_base);
    let mut places: Vec<(f64, Pose2)> = sigmas_behind_the_most(votes, &config.rivals).into_iter().zip(at).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<(f64, Pose2)> = Vec::new();
    for (sigmas_behind, at) in places {
        let is_known = kept.iter().any(|(_, other)| is_near(other, &at, config.same_m, config.same_rad));
        if sigmas_behind < config.confidence.distinct_sigmas && !is_known {
            kept.push((config.confidence.odds(sigmas_behind), at));
        }
    }
    let sum: f64 = kept.iter().map(|(odds, _)| odds).sum();
    let base_from_odom = odom_from_base.inverse();
    kept.into_iter().map(|(odds, at)| Candidate { map_from_odom: at * base_from_odom, share: odds / sum }).collect()
}

/// Odds of the places after the first, by the votes of all, against the one of them that has most
/// pieces of wall right.
pub(super) fn odds_of_others(votes: &[Votes], rivals: &RivalConfig, confidence: &ConfidenceConfig) -> Vec<f64> {
    /// More places would tell nobody anything.
    const MOST: usize = 5;
    let others = votes.get(1..votes.len().min(MOST)).unwrap_or_default();
    sigmas_behind_the_most(others, rivals).into_iter().map(|sigmas| confidence.odds(sigmas)).collect()
}

/// By how many standard deviations each is behind the one with most pieces of wall right.
fn sigmas_behind_the_most(votes: &[Votes], rivals: &RivalConfig) -> Vec<f64> {
    let Some(most) = votes.iter().max_by(|a, b| a.net().total_cmp(&b.net())) else { return Vec::new() };
    votes.iter().map(|of_place| most.sigmas_over_rival(of_place, rivals)).collect()
}

/// How probable each place is when the first one is right with `confidence`: what that leaves goes
/// to the others by their odds. A robot that is elsewhere is at none of them, so that is the most
/// they can have; and none has more than the first.
pub(super) fn probabilities(confidence: f64, others_odds: &[f64]) -> Vec<f64> {
    let sum: f64 = others_odds.iter().sum();
    let others = others_odds.iter().map(|odds| ((1.0 - confidence) * odds / sum).min(confidence));
    std::iter::once(confidence).chain(others).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_first_leaves_is_shared_by_odds() {
        let near = |found: &[f64], expected: &[f64]| {
            assert!(found.len() == expected.len(), "{found:?}");
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        near(&probabilities(0.6, &[3.0, 1.0]), &[0.6, 0.3, 0.1]);
        near(&probabilities(0.2, &[1.0]), &[0.2, 0.2]);
        near(&probabilities(0.9, &[]), &[0.9]);
    }
}
