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
use std::collections::BTreeMap;

/// Which piece of wall each beam of some views ends at.
pub(crate) struct WallSquares {
    /// By view and beam; `None` where nothing returned.
    of_beams: Vec<Vec<Option<usize>>>,
    /// How many pieces there are.
    pub count: usize,
}

/// What a place says of pieces of wall: how many of them it explains, and so on. A piece at which
/// some beams end well and some do not counts in parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Tally {
    /// Pieces that the map has.
    pub explained: f64,
    /// Pieces that stand where the map is free.
    pub too_short: f64,
    /// Pieces that lie behind a wall of the map.
    pub too_long: f64,
}

impl Tally {
    /// How many more it has right than wrong.
    pub fn net(&self) -> f64 {
        self.explained - self.too_short - self.too_long
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
        Self { of_beams, count: numbers.len() }
    }

    /// What a place says, by the verdicts on each beam of each view.
    pub fn tally<'a>(&self, verdicts: impl Iterator<Item = &'a Vec<Option<BeamVerdict>>>) -> Tally {
        let mut sums = vec![(Tally::default(), 0_u32); self.count];
        for (squares, verdicts) in self.of_beams.iter().zip(verdicts) {
            for (square, verdict) in squares.iter().zip(verdicts) {
                let (Some(square), Some(verdict)) = (square, verdict) else { continue };
                let (sum, beams) = &mut sums[*square];
                *beams += 1;
                match verdict {
                    BeamVerdict::Explained => sum.explained += 1.0,
                    BeamVerdict::TooShort => sum.too_short += 1.0,
                    BeamVerdict::TooLong => sum.too_long += 1.0,
                    BeamVerdict::Silent => {}
                }
            }
        }
        sums.iter().fold(Tally::default(), |all, (sum, beams)| {
            let beams = f64::from((*beams).max(1));
            Tally {
                explained: all.explained + sum.explained / beams,
                too_short: all.too_short + sum.too_short / beams,
                too_long: all.too_long + sum.too_long / beams,
            }
        })
    }
}
