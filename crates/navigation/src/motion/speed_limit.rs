//! Ground on which a robot must be slow.

use fht_perception::pose::{Point2, Pose2};

/// So far ahead a robot slows down before ground on which it must be slow, metres.
const SLOW_AHEAD_M: f64 = 0.3;

/// The least of the limits, metres per second, where a robot is and a little ahead of it;
/// `limit_mps` gives that of a place. None if nothing limits it there.
#[must_use]
pub fn speed_limit_ahead(map_from_base: &Pose2, limit_mps: impl Fn(Point2) -> Option<f64>) -> Option<f64> {
    let places = [0.0, SLOW_AHEAD_M].map(|ahead_m| map_from_base * Point2::new(ahead_m, 0.0));
    places.into_iter().filter_map(limit_mps).min_by(f64::total_cmp)
}
