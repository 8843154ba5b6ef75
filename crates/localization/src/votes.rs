//! Which of two places more of what was seen speaks for.

use serde::{Deserialize, Serialize};

/// When a rival may be a place that was mapped in part only.
///
/// Where the map knows nothing, beams tell a rival from the likeliest place, or else every place at
/// the edge of the map would do as well. But where a building repeats itself, the unknown part of a
/// room looks as the same part of its twin does: that the twin explains it says nothing. So these
/// pieces of wall count the less the better the rival is otherwise.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RivalConfig {
    /// They count in full if the map explains at most this share of all pieces at the rival.
    /// Default 0.6, what a wrong place explains by chance.
    pub full_to: f64,
    /// They do not count if it explains at least this share. Default 0.9.
    pub none_from: f64,
    /// They count in full all the same if so many pieces more cannot be at the rival than at the
    /// likeliest place: it is no twin. Default 2.
    pub contradicted_pieces: f64,
    /// And if it is nearer than this, and not turned, metres: then it is the place itself, moved.
    /// Default 2.
    pub least_apart_m: f64,
}

impl Default for RivalConfig {
    fn default() -> Self {
        Self { full_to: 0.6, none_from: 0.9, contradicted_pieces: 2.0, least_apart_m: 2.0 }
    }
}

/// What one piece of wall says of a place, in shares of the beams that end at it. What is left of
/// 1 ends where the map knows nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Vote {
    /// The map has it.
    pub right: f64,
    /// It cannot be.
    pub wrong: f64,
}

impl Vote {
    /// From 1 to −1.
    fn value(self) -> f64 {
        self.right - self.wrong
    }

    fn unknown(self) -> f64 {
        1.0 - self.right - self.wrong
    }
}

/// How each piece of wall votes for a place.
#[derive(Debug)]
pub(crate) struct Votes {
    pieces: Vec<Vote>,
    right: f64,
    wrong: f64,
}

impl Votes {
    /// One vote for each piece.
    pub fn new(pieces: Vec<Vote>) -> Self {
        let right = pieces.iter().map(|piece| piece.right).sum();
        let wrong = pieces.iter().map(|piece| piece.wrong).sum();
        Self { pieces, right, wrong }
    }

    /// How many more pieces it has right than wrong.
    pub fn net(&self) -> f64 {
        self.right - self.wrong
    }

    /// By how many standard deviations more pieces vote for this place than for `other`, of the
    /// same pieces, as if each that votes differently took a side by the toss of a coin (a sign
    /// test; if all vote yes or no it is McNemar's). 0 if all vote the same.
    pub fn sigmas_over(&self, other: &Self) -> f64 {
        sigmas(self.differences(other))
    }

    /// The same over a place that may be mapped in part: no more than over any other, and not
    /// behind it where that would not be.
    pub fn sigmas_over_rival(&self, rival: &Self, config: &RivalConfig) -> f64 {
        let (plain, discount) = (self.sigmas_over(rival), rival.discount(self.wrong, config));
        if discount == 0.0 {
            return plain;
        }
        let unknown = rival.pieces.iter().map(|vote| vote.unknown());
        let counted = |(difference, unknown): (f64, f64)| difference - discount * unknown.min(difference.max(0.0));
        sigmas(self.differences(rival).zip(unknown).map(counted)).clamp(plain.min(0.0), plain.max(0.0))
    }

    fn differences(&self, other: &Self) -> impl Iterator<Item = f64> {
        debug_assert_eq!(self.pieces.len(), other.pieces.len(), "votes of the same pieces");
        self.pieces.iter().zip(&other.pieces).map(|(here, there)| here.value() - there.value())
    }

    /// By how much less pieces count of which the map knows nothing here, from 0 to 1, beside a
    /// place that so many pieces contradict.
    fn discount(&self, wrong_there: f64, config: &RivalConfig) -> f64 {
        let explained = self.right / (self.pieces.len() as f64).max(1.0);
        let excess = (self.wrong - wrong_there).max(0.0);
        ramp(explained, config.full_to, config.none_from) * (1.0 - ramp(excess, 0.0, config.contradicted_pieces))
    }
}

/// From 0 at `from` to 1 at `to`; a step where the one is not below the other.
fn ramp(value: f64, from: f64, to: f64) -> f64 {
    if value >= to {
        1.0
    } else if value <= from {
        0.0
    } else {
        (value - from) / (to - from)
    }
}

/// The least of several; infinite without any.
pub(crate) fn least(sigmas: impl Iterator<Item = f64>) -> f64 {
    sigmas.fold(f64::INFINITY, f64::min)
}

/// The sum of differences between two votes, in standard deviations of that sum.
fn sigmas(differences: impl Iterator<Item = f64>) -> f64 {
    // A part of a vote counts as a vote that is cast in so many of all cases: to differ by little
    // in many pieces is not to differ in many.
    let add = |(sum, variance): (f64, f64), by: f64| (sum + by, variance + by.abs().max(by * by));
    let (sum, variance) = differences.fold((0.0, 0.0), add);
    if variance > 0.0 { sum / variance.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// So many pieces each that are right, wrong, unknown.
    fn votes(counts: &[(usize, Vote)]) -> Votes {
        Votes::new(counts.iter().flat_map(|&(count, vote)| vec![vote; count]).collect())
    }

    const RIGHT: Vote = Vote { right: 1.0, wrong: 0.0 };
    const WRONG: Vote = Vote { right: 0.0, wrong: 1.0 };
    const UNKNOWN: Vote = Vote { right: 0.0, wrong: 0.0 };

    #[test]
    fn pieces_that_vote_the_same_tell_nothing() {
        let (here, there) = (votes(&[(9, RIGHT)]), votes(&[(9, UNKNOWN)]));
        assert!((here.sigmas_over(&there) - 3.0).abs() < 1e-12, "nine to none");
        let (here, there) = (votes(&[(59, RIGHT)]), votes(&[(9, UNKNOWN), (50, RIGHT)]));
        assert!((here.sigmas_over(&there) - 3.0).abs() < 1e-12);
        assert_eq!(here.sigmas_over(&here), 0.0);
    }

    #[test]
    fn pieces_that_vote_for_the_other_place_weaken_those_that_vote_for_this_one() {
        // Twelve more either way: of twelve, and of 36.
        let all = votes(&[(12, RIGHT)]).sigmas_over(&votes(&[(12, UNKNOWN)]));
        let (here, there) = (votes(&[(24, RIGHT), (12, UNKNOWN)]), votes(&[(24, UNKNOWN), (12, RIGHT)]));
        let torn = here.sigmas_over(&there);
        assert!((all - 12.0 / 12.0_f64.sqrt()).abs() < 1e-12 && (torn - 12.0 / 6.0).abs() < 1e-12, "{all}, {torn}");
    }

    #[test]
    fn a_rival_that_is_mapped_in_part_is_told_by_what_cannot_be_there() {
        let config = RivalConfig::default();
        let here = votes(&[(90, RIGHT)]);
        let known = votes(&[(81, RIGHT), (9, UNKNOWN)]);
        assert!((here.sigmas_over(&known) - 3.0).abs() < 1e-12);
        assert_eq!(here.sigmas_over_rival(&known, &config), 0.0, "it is as good");
        let less_known = votes(&[(69, RIGHT), (21, UNKNOWN)]);
        let between = here.sigmas_over_rival(&less_known, &config);
        assert!(between > 2.0 && between < here.sigmas_over(&less_known) - 1.0, "{between}");
        for told in [votes(&[(54, RIGHT), (36, UNKNOWN)]), votes(&[(81, RIGHT), (7, UNKNOWN), (2, WRONG)])] {
            assert!((here.sigmas_over_rival(&told, &config) - here.sigmas_over(&told)).abs() < 1e-12);
        }
        // What cannot be at either tells nothing.
        let (here, there) = (votes(&[(87, RIGHT), (3, WRONG)]), votes(&[(82, RIGHT), (5, UNKNOWN), (3, WRONG)]));
        assert_eq!(here.sigmas_over_rival(&there, &config), 0.0);
    }

    #[test]
    fn a_place_that_is_ahead_is_not_put_behind() {
        // Five pieces more, nine that the rival does not know, and four that it knows better.
        let here = votes(&[(41, RIGHT), (4, UNKNOWN)]);
        let there = votes(&[(32, RIGHT), (9, UNKNOWN), (4, RIGHT)]);
        assert!(here.sigmas_over(&there) > 1.3);
        assert_eq!(here.sigmas_over_rival(&there, &RivalConfig::default()), 0.0);
        assert!(there.sigmas_over_rival(&here, &RivalConfig::default()) < 0.0);
    }

    #[test]
    fn limits_without_width_are_steps() {
        let (here, there) = (votes(&[(45, RIGHT)]), votes(&[(36, RIGHT), (9, UNKNOWN)]));
        let sigmas = |config| here.sigmas_over_rival(&there, &config);
        let usual = RivalConfig::default();
        assert_eq!(sigmas(RivalConfig { full_to: 0.8, none_from: 0.8, ..usual.clone() }), 0.0);
        assert_eq!(sigmas(RivalConfig { full_to: 0.9, none_from: 0.9, ..usual.clone() }), here.sigmas_over(&there));
        assert_eq!(sigmas(RivalConfig { contradicted_pieces: 0.0, ..usual }), here.sigmas_over(&there));
    }

    /// Of which the one has much that is right, as far as anything is known.
    fn any_votes() -> impl Strategy<Value = (Votes, Votes)> {
        let vote = |least: f64| {
            (least..=1.0, 0.0..=1.0).prop_map(|(right, wrong)| Vote { right, wrong: 0.2 * wrong * (1.0 - right) })
        };
        prop::collection::vec((vote(0.0), vote(0.65)), 1..50).prop_map(|pairs| {
            let (here, there) = pairs.into_iter().unzip();
            (Votes::new(here), Votes::new(there))
        })
    }

    proptest! {
        #[test]
        fn what_one_has_more_the_other_has_less((here, there) in any_votes()) {
            let sigmas = here.sigmas_over(&there);
            prop_assert!((sigmas + there.sigmas_over(&here)).abs() < 1e-9);
            prop_assert!(sigmas.abs() <= (here.pieces.len() as f64).sqrt() + 1e-9);
        }

        #[test]
        fn what_is_unknown_at_a_rival_makes_nothing_surer((here, there) in any_votes()) {
            let config = RivalConfig { contradicted_pieces: 50.0, ..RivalConfig::default() };
            prop_assert!(there.discount(here.wrong, &config) > 0.0);
            let (plain, over) = (here.sigmas_over(&there), here.sigmas_over_rival(&there, &config));
            prop_assert!(over <= plain.max(0.0) && over >= plain.min(0.0), "{over} of {plain}");
        }

        #[test]
        fn to_differ_by_less_is_to_be_less_sure(differences in prop::collection::vec(-1.0..=1.0, 0..50), share in 0.0..=1.0) {
            let of = |share: f64| sigmas(differences.iter().map(|difference| share * difference));
            prop_assert!(of(share).abs() <= of(1.0).abs() + 1e-9, "{} of {}", of(share), of(1.0));
        }
    }
}
