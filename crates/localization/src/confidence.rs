//! How probable it is that a place is right.
//!
//! A place is as sure as its weakest ground, and less sure if others are nearly as weak. The
//! grounds are: the map explains more of what was seen than a wrong place does by chance; it
//! explains much less of it at any rival, and at this place, moved a little; what was seen was seen
//! from places that are apart. What they are worth was fitted to recorded drives, and tried on logs
//! that were left out (`evaluate recorded --looks`, `evaluate confidence`).

use crate::place_evidence::PlaceEvidence;
use serde::{Deserialize, Serialize};

/// What a place's grounds are worth.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ConfidenceConfig {
    /// Share of the pieces of wall that a wrong place explains by chance, when it is looked for in
    /// a whole map. Default 0.6.
    pub explained_by_chance: f64,
    /// A piece that cannot be outweighs so many that are explained. Default 2: at a wrong place
    /// that is much like the true one few pieces cannot be, but more than at the true one.
    pub contradicted_weight: f64,
    /// A ground of 1 explains more than that by this many standard deviations, as if each piece of
    /// wall were explained or not by the toss of a coin. Default 1.5.
    pub explained_sigmas: f64,
    /// The pieces count in full if the views are this far apart, metres: from one place all are
    /// seen with the same errors. Default 2.
    pub full_spread_m: f64,
    /// A ground of 1 is this many standard deviations ahead of any rival, and of the place itself,
    /// moved, by the votes of pieces of wall. Pieces that lie side by side vote together, so these
    /// are fewer deviations than they seem. Default 2.75.
    pub distinct_sigmas: f64,
    /// A ground of 1 has views this far apart, metres. Default 0.7.
    pub spread_m: f64,
    /// How sharply the weakest ground stands out: all together are worth their soft minimum, -ln
    /// Σ exp(-sharpness · ground) / sharpness. Default 4, as `slope`: each ground is a way to be
    /// wrong, and these probabilities add up.
    pub sharpness: f64,
    /// The ground of a place that is right as often as not. Default 0: with as strong a rival it
    /// is.
    pub even: f64,
    /// How fast the odds grow with the ground, natural logarithm. Default 4: 0.98 at a ground of 1.
    pub slope: f64,
}

impl Default for ConfidenceConfig {
    fn default() -> Self {
        Self {
            explained_by_chance: 0.6,
            contradicted_weight: 2.0,
            explained_sigmas: 1.5,
            full_spread_m: 2.0,
            distinct_sigmas: 2.75,
            spread_m: 0.7,
            sharpness: 4.0,
            even: 0.0,
            slope: 4.0,
        }
    }
}

impl ConfidenceConfig {
    /// How probable a place is, 0 to 1, by what speaks for it.
    #[must_use]
    pub fn probability(&self, for_it: &PlaceEvidence) -> f64 {
        let probability = 1.0 / (1.0 + (-self.slope * (self.ground(for_it) - self.even)).exp());
        // Not a number where a configuration asks for 0 of something.
        if probability.is_nan() { 0.0 } else { probability }
    }

    /// How probable a place is against one that it is behind by so many standard deviations: their
    /// odds, 1 if they are even.
    #[must_use]
    pub fn odds(&self, sigmas_behind: f64) -> f64 {
        (-self.slope * sigmas_behind.max(0.0) / self.distinct_sigmas).exp()
    }

    /// A place's grounds together: 1 suffices, less than 0 speaks against it.
    #[must_use]
    pub fn ground(&self, for_it: &PlaceEvidence) -> f64 {
        /// A pose that only the odometry holds may be off by some degrees.
        const NOT_HELD: f64 = 0.5;
        let right = for_it.explained - self.contradicted_weight * for_it.contradicted();
        let deviation = 0.5 / for_it.walls.max(1.0).sqrt();
        let sigmas = (right - self.explained_by_chance) / deviation;
        let explained = sigmas * (for_it.spread_m / self.full_spread_m).min(1.0) / self.explained_sigmas;
        let distinct = for_it.over_moved_sigmas.min(for_it.over_rivals_sigmas) / self.distinct_sigmas;
        let apart = for_it.spread_m / self.spread_m;
        let held = if for_it.is_held { f64::INFINITY } else { NOT_HELD };
        let grounds = [explained, distinct, apart, held];
        let weakest = grounds.into_iter().fold(f64::INFINITY, f64::min);
        let odds: f64 = grounds.into_iter().map(|ground| (-self.sharpness * (ground - weakest)).exp()).sum();
        weakest - odds.ln() / self.sharpness
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room seen from two places, and nothing like it.
    fn sure() -> PlaceEvidence {
        PlaceEvidence {
            walls: 80.0,
            explained: 0.95,
            too_short: 0.01,
            somebody: 0.0,
            too_long: 0.0,
            seen_through: 0.0,
            over_rivals_sigmas: f64::INFINITY,
            over_moved_sigmas: 6.0,
            spread_m: 2.0,
            is_held: true,
        }
    }

    #[test]
    fn each_ground_alone_can_make_a_place_doubtful() {
        let config = ConfidenceConfig::default();
        assert!(config.probability(&sure()) > 0.985);
        let doubtful = [
            PlaceEvidence { explained: 0.62, ..sure() },
            PlaceEvidence { too_short: 0.3, ..sure() },
            PlaceEvidence { too_long: 0.3, ..sure() },
            PlaceEvidence { over_rivals_sigmas: 1.2, ..sure() },
            PlaceEvidence { over_moved_sigmas: 1.2, ..sure() },
            PlaceEvidence { over_rivals_sigmas: -1.5, ..sure() },
            PlaceEvidence { spread_m: 0.3, ..sure() },
            PlaceEvidence { walls: 4.0, over_moved_sigmas: 1.7, ..sure() },
            PlaceEvidence { is_held: false, ..sure() },
        ];
        for place in doubtful {
            let probability = config.probability(&place);
            assert!((0.0..0.95).contains(&probability), "{probability} of {place:?}");
        }
    }

    #[test]
    fn what_cannot_be_says_more_than_what_is_not_explained() {
        let config = ConfidenceConfig::default();
        let unknown = PlaceEvidence { explained: 0.70, too_short: 0.0, ..sure() };
        let contradicted = PlaceEvidence { explained: 0.73, too_long: 0.03, ..unknown };
        assert!(config.probability(&contradicted) < config.probability(&unknown));
    }

    #[test]
    fn grounds_that_are_nearly_as_weak_count_together() {
        let config = ConfidenceConfig::default();
        // A ground of 1.02, and nothing else that could be wrong.
        let one_weak = PlaceEvidence { over_moved_sigmas: 2.81, ..sure() };
        assert!(config.probability(&one_weak) > 0.982);
        // What is explained is worth 1.2 now.
        let two_weak = PlaceEvidence { walls: 50.0, explained: 0.73, ..one_weak };
        assert!(config.probability(&two_weak) < 0.98);
        assert!(config.ground(&two_weak) < config.ground(&one_weak));
    }

    #[test]
    fn of_two_places_that_are_alike_either_may_be_right() {
        let tie = PlaceEvidence { over_rivals_sigmas: 0.0, ..sure() };
        assert!((0.45..=0.5).contains(&ConfidenceConfig::default().probability(&tie)));
    }

    #[test]
    fn odds_fall_with_what_a_place_has_less() {
        let config = ConfidenceConfig::default();
        let odds = [0.0, 1.0, 2.0, 2.75].map(|less| config.odds(less));
        assert!((odds[0] - 1.0).abs() < 1e-12 && odds.windows(2).all(|pair| pair[1] < pair[0]), "{odds:?}");
        assert!(odds[3] < 0.02, "{odds:?}");
    }

    #[test]
    fn nothing_seen_is_no_ground() {
        let nothing = PlaceEvidence::default();
        assert!(ConfidenceConfig::default().probability(&nothing) <= 0.5);
    }
}
