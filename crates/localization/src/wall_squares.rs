//! What was seen, as pieces of wall: each counts once, however often it was seen.
//!
//! Beams that end at one piece of wall are not independent: they are explained or contradicted
//! together, in one scan and in the next. What the views saw is divided into squares of the
//! odometry frame, and each square has one voice. A robot that stands still, or that drives along a
//! corridor whose walls it has seen already, learns nothing.

use crate::hypotheses::SensedView;
use fht_perception::evidence_grid::BeamVerdict;
use fht_perception::pose::Point2;
use fht_perception::square::{SquareIndex, square_of};
use std::borrow::Borrow;
use std::collections::BTreeMap;

/// Which piece of wall each beam of some views ends at.
pub(crate) struct WallSquares {
    /// By view and beam; `None` where nothing returned.
    of_beams: Vec<Vec<Option<usize>>>,
    /// How many pieces there are.
    pub count: usize,
    /// Side of a square, metres.
    side_m: f64,
}

/// What a place says of pieces of wall: how many of them it explains, and so on. A piece at which
/// some beams end well and some do not counts in parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tally {
    /// Pieces that the map has.
    pub explained: f64,
    /// Pieces that stand where the map is free, and are nobody.
    pub too_short: f64,
    /// Pieces that stand there, and may be somebody.
    pub somebody: f64,
    /// Pieces that lie behind a wall of the map.
    pub too_long: f64,
}

/// How each piece of wall votes for a place, from 1 (the map has it) to −1 (it cannot be).
pub(crate) struct Votes(Vec<f64>);

impl Votes {
    /// How many more pieces it has right than wrong.
    pub fn net(&self) -> f64 {
        self.0.iter().sum()
    }

    /// By how many standard deviations more pieces vote for this place than for `other`, of the
    /// same pieces, as if each that votes differently took a side by the toss of a coin (a sign
    /// test; if all vote yes or no it is McNemar's). 0 if all vote the same.
    pub fn sigmas_over(&self, other: &Self) -> f64 {
        debug_assert_eq!(self.0.len(), other.0.len(), "votes of the same pieces");
        let differences = || self.0.iter().zip(&other.0).map(|(here, there)| here - there);
        // A part of a vote counts as a vote that is cast in so many of all cases: to differ by
        // little in many pieces is not to differ in many.
        let variance: f64 = differences().map(|difference| difference.abs().max(difference * difference)).sum();
        if variance > 0.0 { differences().sum::<f64>() / variance.sqrt() } else { 0.0 }
    }

    /// The same over that of several others that is least behind; infinite without others.
    pub fn least_sigmas_over(&self, others: impl Iterator<Item = impl Borrow<Self>>) -> f64 {
        others.map(|other| self.sigmas_over(other.borrow())).fold(f64::INFINITY, f64::min)
    }
}

impl WallSquares {
    /// Of what `views` saw, in squares of this side.
    pub fn of(views: &[SensedView], side_m: f64) -> Self {
        let mut numbers: BTreeMap<SquareIndex, usize> = BTreeMap::new();
        let mut of_beams = Vec::with_capacity(views.len());
        for view in views {
            let mut number = |end: Option<Point2>| {
                let end = view.odometry.odom_from_base * end?;
                let next = numbers.len();
                Some(*numbers.entry(square_of(end, side_m)).or_insert(next))
            };
            of_beams.push(view.beams.ends().map(&mut number).collect());
        }
        Self { of_beams, count: numbers.len(), side_m }
    }

    /// What a place says, by the verdicts on each beam of each view.
    pub fn tally(&self, verdicts: &[Vec<Option<BeamVerdict>>]) -> Tally {
        self.shares(verdicts).fold(Tally::default(), |all, piece| Tally {
            explained: all.explained + piece.explained,
            too_short: all.too_short + piece.too_short,
            somebody: all.somebody + piece.somebody,
            too_long: all.too_long + piece.too_long,
        })
    }

    /// Pieces of the map's walls that beams went through. However much a wall hides that is gone,
    /// or was somebody, it is one thing that is wrong.
    pub fn seen_through(&self, verdicts: &[Vec<Option<BeamVerdict>>]) -> f64 {
        let mut pieces: BTreeMap<SquareIndex, (f64, f64)> = BTreeMap::new();
        for verdict in verdicts.iter().flatten().flatten() {
            let (wall, passed) = match verdict {
                BeamVerdict::TooLong(wall) => (wall, 1.0),
                BeamVerdict::Explained(wall) => (wall, 0.0),
                BeamVerdict::TooShort | BeamVerdict::Somebody | BeamVerdict::Silent => continue,
            };
            let (sum, beams) = pieces.entry(square_of(*wall, self.side_m)).or_default();
            *sum += passed;
            *beams += 1.0;
        }
        pieces.values().map(|(passed, beams)| passed / beams).sum()
    }

    /// How each piece votes for a place, by the same.
    pub fn votes(&self, verdicts: &[Vec<Option<BeamVerdict>>]) -> Votes {
        Votes(
            self.shares(verdicts)
                .map(|piece| piece.explained - piece.too_short - piece.somebody - piece.too_long)
                .collect(),
        )
    }

    /// Of each piece, the shares of its beams.
    fn shares(&self, verdicts: &[Vec<Option<BeamVerdict>>]) -> impl Iterator<Item = Tally> {
        let mut sums = vec![(Tally::default(), 0_u32); self.count];
        for (squares, verdicts) in self.of_beams.iter().zip(verdicts) {
            for (square, verdict) in squares.iter().zip(verdicts) {
                let (Some(square), Some(verdict)) = (square, verdict) else { continue };
                let (sum, beams) = &mut sums[*square];
                *beams += 1;
                match verdict {
                    BeamVerdict::Explained(_) => sum.explained += 1.0,
                    BeamVerdict::TooShort => sum.too_short += 1.0,
                    BeamVerdict::Somebody => sum.somebody += 1.0,
                    BeamVerdict::TooLong(_) => sum.too_long += 1.0,
                    BeamVerdict::Silent => {}
                }
            }
        }
        sums.into_iter().map(|(sum, beams)| {
            let beams = f64::from(beams.max(1));
            Tally {
                explained: sum.explained / beams,
                too_short: sum.too_short / beams,
                somebody: sum.somebody / beams,
                too_long: sum.too_long / beams,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn pieces_that_vote_the_same_tell_nothing() {
        let (here, there) = (Votes(vec![1.0; 9]), Votes(vec![0.0; 9]));
        assert!((here.sigmas_over(&there) - 3.0).abs() < 1e-12, "nine to none");
        let with_common = |votes: &Votes| Votes(votes.0.iter().copied().chain([1.0; 50]).collect());
        assert!((with_common(&here).sigmas_over(&with_common(&there)) - 3.0).abs() < 1e-12);
        assert_eq!(here.sigmas_over(&here), 0.0);
        assert_eq!(here.least_sigmas_over(std::iter::empty::<Votes>()), f64::INFINITY);
    }

    #[test]
    fn pieces_that_vote_for_the_other_place_weaken_those_that_vote_for_this_one() {
        // Twelve more either way: of twelve, and of 36.
        let all = Votes(vec![1.0; 12]).sigmas_over(&Votes(vec![0.0; 12]));
        let (mut here, mut there) = (vec![1.0; 24], vec![0.0; 24]);
        here.extend([0.0; 12]);
        there.extend([1.0; 12]);
        let torn = Votes(here).sigmas_over(&Votes(there));
        assert!((all - 12.0 / 12.0_f64.sqrt()).abs() < 1e-12 && (torn - 12.0 / 6.0).abs() < 1e-12, "{all}, {torn}");
    }

    #[test]
    fn however_much_is_seen_through_a_wall_it_is_one_wall() {
        let (near, there) = (Point2::new(0.1, 0.1), Point2::new(3.2, 0.1));
        let judge = |verdicts: Vec<BeamVerdict>| {
            let of_beams = vec![(0..verdicts.len()).map(Some).collect()];
            let squares = WallSquares { of_beams, count: verdicts.len(), side_m: 0.5 };
            let verdicts = [verdicts.into_iter().map(Some).collect()];
            (squares.seen_through(&verdicts), squares.tally(&verdicts))
        };
        let (gone, tally) = judge([vec![BeamVerdict::TooLong(near); 9], vec![BeamVerdict::Explained(there)]].concat());
        assert!((gone - 1.0).abs() < 1e-12 && (tally.explained - 1.0).abs() < 1e-12, "{gone}, {tally:?}");
        // As many end at it as go on: half of it is gone.
        let (half, _) = judge([vec![BeamVerdict::TooLong(near); 4], vec![BeamVerdict::Explained(near); 4]].concat());
        assert!((half - 0.5).abs() < 1e-12, "{half}");
    }

    proptest! {
        #[test]
        fn what_one_has_more_the_other_has_less(pairs in prop::collection::vec((-1.0..=1.0, -1.0..=1.0), 0..50)) {
            let (here, there): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
            let (here, there) = (Votes(here), Votes(there));
            let sigmas = here.sigmas_over(&there);
            prop_assert!((sigmas + there.sigmas_over(&here)).abs() < 1e-9);
            prop_assert!(sigmas.abs() <= (here.0.len() as f64).sqrt() + 1e-9);
        }

        #[test]
        fn to_differ_by_less_is_to_be_less_sure(differences in prop::collection::vec(-1.0..=1.0, 0..50), share in 0.0..=1.0) {
            let sigmas = |share: f64| {
                let here: Vec<f64> = differences.iter().map(|difference| share * difference).collect();
                let there = Votes(vec![0.0; here.len()]);
                Votes(here).sigmas_over(&there)
            };
            prop_assert!(sigmas(share).abs() <= sigmas(1.0).abs() + 1e-9, "{} of {}", sigmas(share), sigmas(1.0));
        }
    }
}
