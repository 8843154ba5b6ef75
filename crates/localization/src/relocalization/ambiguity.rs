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
