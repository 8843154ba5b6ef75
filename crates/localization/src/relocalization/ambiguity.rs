//! Which places all that was seen does not tell apart.

use super::RelocalizationConfig;
use crate::hypotheses::{Hypothesis, is_near};
use crate::votes::Votes;
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
    let behind = sigmas_behind_the_most(hypotheses, votes, config);
    let all = behind.into_iter().zip(hypotheses.iter().zip(votes));
    let mut places: Vec<(f64, f64, Pose2)> =
        all.map(|(sigmas, (place, votes))| (sigmas, votes.net(), place.map_from_base())).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    let mut kept: Vec<(f64, Pose2)> = Vec::new();
    for (sigmas_behind, _, at) in places {
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
pub(super) fn odds_of_others(hypotheses: &[Hypothesis], votes: &[Votes], config: &RelocalizationConfig) -> Vec<f64> {
    /// More places would tell nobody anything.
    const MOST: usize = 5;
    let others = 1..votes.len().min(MOST);
    let Some((places, votes)) = hypotheses.get(others.clone()).zip(votes.get(others)) else { return Vec::new() };
    let behind = sigmas_behind_the_most(places, votes, config);
    behind.into_iter().map(|sigmas| config.confidence.odds(sigmas)).collect()
}

/// By how many standard deviations each is behind the one with most pieces of wall right.
fn sigmas_behind_the_most(hypotheses: &[Hypothesis], votes: &[Votes], config: &RelocalizationConfig) -> Vec<f64> {
    let all = || hypotheses.iter().zip(votes);
    let Some(most) = all().max_by(|(_, a), (_, b)| a.net().total_cmp(&b.net())) else { return Vec::new() };
    all().map(|other| sigmas_ahead(most, other, config)).collect()
}

/// By how many standard deviations a place is ahead of another, by their votes.
pub(super) fn sigmas_ahead(
    (place, votes): (&Hypothesis, &Votes),
    (other, votes_there): (&Hypothesis, &Votes),
    config: &RelocalizationConfig,
) -> f64 {
    if place.is_near(&other.map_from_base(), config.rivals.least_apart_m, config.same_rad) {
        votes.sigmas_over(votes_there)
    } else {
        votes.sigmas_over_rival(votes_there, &config.rivals)
    }
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
