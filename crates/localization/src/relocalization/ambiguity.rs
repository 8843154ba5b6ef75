//! Which places all that was seen does not tell apart.

use super::RelocalizationConfig;
use crate::hypotheses::{Hypothesis, SensedView, is_near};
use crate::wall_squares::WallSquares;
use fht_perception::candidate::Candidate;
use fht_perception::pose::Pose2;

/// The places than which none has enough pieces of wall right more, most probable first.
pub(super) fn not_told_apart(
    hypotheses: &[Hypothesis],
    views: &[SensedView],
    config: &RelocalizationConfig,
) -> Vec<Candidate> {
    let Some(last) = views.last() else { return Vec::new() };
    let squares = WallSquares::of(views, config.square_m);
    let right = |place: &Hypothesis| squares.tally(place.verdicts.iter()).net();
    let mut places: Vec<(f64, Pose2)> = hypotheses.iter().map(|place| (right(place), place.map_from_base())).collect();
    places.sort_by(|a, b| b.0.total_cmp(&a.0));
    let most = places.first().map_or(0.0, |(right, _)| *right);
    let mut kept: Vec<(f64, Pose2)> = Vec::new();
    for (right, at) in places {
        let is_known = kept.iter().any(|(_, other)| is_near(other, &at, config.same_m, config.same_rad));
        if most - right < config.confidence.distinct_pieces && !is_known {
            kept.push((config.confidence.odds(most - right), at));
        }
    }
    let sum: f64 = kept.iter().map(|(odds, _)| odds).sum();
    let base_from_odom = last.odometry.odom_from_base.inverse();
    kept.into_iter().map(|(odds, at)| Candidate { map_from_odom: at * base_from_odom, share: odds / sum }).collect()
}

/// Odds of the places after the first, against the one of them that has most pieces of wall right.
pub(super) fn odds_of_others(
    hypotheses: &[Hypothesis],
    views: &[SensedView],
    config: &RelocalizationConfig,
) -> Vec<f64> {
    /// More places would tell nobody anything.
    const MOST: usize = 5;
    let squares = WallSquares::of(views, config.square_m);
    let others = hypotheses.iter().take(MOST).skip(1);
    let right: Vec<f64> = others.map(|place| squares.tally(place.verdicts.iter()).net()).collect();
    let most = right.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    right.iter().map(|right| config.confidence.odds(most - right)).collect()
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
