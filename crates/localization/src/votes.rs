//! Which of two places more of what was seen speaks for.

use serde::{Deserialize, Serialize};

/// When a rival may be a place that was mapped in part only.
///
/// What the map does not know of a rival tells it from the likeliest place, or else every place at
/// the edge of the map would do as well. But where a building repeats itself, the unknown part of a
/// room looks as the same part of its twin does: that the twin explains it says nothing.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RivalConfig {
    /// Pieces of wall that the map does not know at a rival tell it in full if it explains at most
    /// this share of all pieces. Default 0.5.
    pub explained_by_chance: f64,
    /// They tell nothing if it explains at least this share. Default 0.8.
    pub partly_mapped: f64,
    /// … and tell it in full again if so many pieces more cannot be at the rival than at the place.
    /// Default 3.
    pub contradicted_pieces: f64,
}

impl Default for RivalConfig {
    fn default() -> Self {
        Self { explained_by_chance: 0.5, partly_mapped: 0.8, contradicted_pieces: 3.0 }
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

    /// The same over another place that may be the right one: what the map does not know there
    /// counts the less the better that place is otherwise.
    pub fn sigmas_over_rival(&self, rival: &Self, config: &RivalConfig) -> f64 {
        let pardoned = rival.partly_mapped(self.wrong, config);
        let unknown = rival.pieces.iter().map(|vote| vote.unknown());
        let pardon = |(difference, unknown): (f64, f64)| difference - pardoned * unknown.min(difference.max(0.0));
        sigmas(self.differences(rival).zip(unknown).map(pardon))
    }

    fn differences(&self, other: &Self) -> impl Iterator<Item = f64> {
        debug_assert_eq!(self.pieces.len(), other.pieces.len(), "votes of the same pieces");
        self.pieces.iter().zip(&other.pieces).map(|(here, there)| here.value() - there.value())
    }

    /// How far this may be a place that was mapped in part only, from 0 to 1, beside one that so
    /// many pieces contradict.
    fn partly_mapped(&self, wrong_there: f64, config: &RivalConfig) -> f64 {
        let RivalConfig { explained_by_chance, partly_mapped, contradicted_pieces } = *config;
        let explained = self.right / (self.pieces.len() as f64).max(1.0);
        let fits = (explained - explained_by_chance) / (partly_mapped - explained_by_chance);
        let is_told = (self.wrong - wrong_there) / contradicted_pieces;
        fits.clamp(0.0, 1.0) * (1.0 - is_told).clamp(0.0, 1.0)
    }
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
        let here = votes(&[(45, RIGHT)]);
        let known = votes(&[(36, RIGHT), (9, UNKNOWN)]);
        assert!((here.sigmas_over(&known) - 3.0).abs() < 1e-12);
        assert_eq!(here.sigmas_over_rival(&known, &config), 0.0, "it is as good");
        let half_known = votes(&[(30, RIGHT), (15, UNKNOWN)]);
        let between = here.sigmas_over_rival(&half_known, &config);
        assert!(between > 0.0 && between < 2.75, "{between}");
        for told in [votes(&[(22, RIGHT), (23, UNKNOWN)]), votes(&[(36, RIGHT), (6, UNKNOWN), (3, WRONG)])] {
            assert!((here.sigmas_over_rival(&told, &config) - here.sigmas_over(&told)).abs() < 1e-12);
        }
        // What cannot be at either tells nothing.
        let (here, there) = (votes(&[(42, RIGHT), (3, WRONG)]), votes(&[(36, RIGHT), (6, UNKNOWN), (3, WRONG)]));
        assert_eq!(here.sigmas_over_rival(&there, &config), 0.0);
    }

    fn any_votes() -> impl Strategy<Value = (Votes, Votes)> {
        let vote = || {
            (0.0..=1.0, 0.0..=1.0)
                .prop_map(|(known, right)| Vote { right: known * right, wrong: known * (1.0 - right) })
        };
        prop::collection::vec((vote(), vote()), 0..50).prop_map(|pairs| {
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
        fn to_pardon_what_is_unknown_makes_nothing_surer((here, there) in any_votes()) {
            prop_assert!(here.sigmas_over_rival(&there, &RivalConfig::default()) <= here.sigmas_over(&there) + 1e-9);
        }

        #[test]
        fn to_differ_by_less_is_to_be_less_sure(differences in prop::collection::vec(-1.0..=1.0, 0..50), share in 0.0..=1.0) {
            let of = |share: f64| sigmas(differences.iter().map(|difference| share * difference));
            prop_assert!(of(share).abs() <= of(1.0).abs() + 1e-9, "{} of {}", of(share), of(1.0));
        }
    }
}
