//! What was seen, as pieces of wall: each counts once, however often it was seen.
//!
//! Beams that end at one piece of wall are not independent: they are explained or contradicted
//! together, in one scan and in the next. What the views saw is divided into squares of the
//! odometry frame, and each square has one voice. A robot that stands still, or that drives along a
//! corridor whose walls it has seen already, learns nothing.

use crate::hypotheses::SensedView;
use crate::votes::{Vote, Votes};
use fht_perception::evidence_grid::BeamVerdict;
use fht_perception::pose::Point2;
use fht_perception::square::{SquareIndex, square_of};
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
        let vote =
            |piece: Tally| Vote { right: piece.explained, wrong: piece.too_short + piece.somebody + piece.too_long };
        Votes::new(self.shares(verdicts).map(vote).collect())
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
}
