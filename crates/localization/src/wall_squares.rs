//! What was seen, as pieces of wall: each counts once, however often it was seen.
//!
//! Beams that end at one piece of wall are not independent: they are explained or contradicted
//! together, in one scan and in the next. What the views saw is divided into squares of the
//! odometry frame, and each square has one voice. A robot that stands still, or that drives along a
//! corridor whose walls it has seen already, learns nothing.

use crate::hypotheses::{Hypothesis, SensedView};
use fht_perception::evidence_grid::BeamVerdict;
use fht_perception::pose::Point2;
use std::collections::BTreeMap;

/// Which piece of wall each beam of some views ends at.
pub(crate) struct WallSquares {
    /// By view and beam; `None` where nothing returned.
    of_beams: Vec<Vec<Option<usize>>>,
    count: usize,
}

/// What a hypothesis says of one piece of wall: shares of the beams that end there.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SquareVerdict {
    pub explained: f64,
    pub contradicted: f64,
}

impl WallSquares {
    /// Of what `views` saw, in squares of this side.
    pub fn of(views: &[SensedView], side_m: f64) -> Self {
        let mut numbers: BTreeMap<(i64, i64), usize> = BTreeMap::new();
        let mut of_beams = Vec::with_capacity(views.len());
        for view in views {
            let mut number = |end: Option<Point2>| {
                let end = view.odometry.odom_from_base * end?;
                let square = ((end.x / side_m).floor() as i64, (end.y / side_m).floor() as i64);
                let next = numbers.len();
                Some(*numbers.entry(square).or_insert(next))
            };
            of_beams.push(view.beams.ends().map(&mut number).collect());
        }
        Self { of_beams, count: numbers.len() }
    }

    /// What `hypothesis` says of each piece.
    pub fn judged_by(&self, hypothesis: &Hypothesis) -> Vec<SquareVerdict> {
        let mut sums = vec![(SquareVerdict::default(), 0_u32); self.count];
        for (squares, verdicts) in self.of_beams.iter().zip(&hypothesis.verdicts) {
            for (square, verdict) in squares.iter().zip(verdicts) {
                let (Some(square), Some(verdict)) = (square, verdict) else { continue };
                let (sum, beams) = &mut sums[*square];
                *beams += 1;
                match verdict {
                    BeamVerdict::Explained => sum.explained += 1.0,
                    BeamVerdict::Contradicted => sum.contradicted += 1.0,
                    BeamVerdict::Silent => {}
                }
            }
        }
        let share = |(sum, beams): (SquareVerdict, u32)| {
            let beams = f64::from(beams.max(1));
            SquareVerdict { explained: sum.explained / beams, contradicted: sum.contradicted / beams }
        };
        sums.into_iter().map(share).collect()
    }
}

/// What speaks for the likeliest place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaceEvidence {
    /// Pieces of wall that were seen.
    pub walls: f64,
    /// Share of them that the map explains, 0 to 1.
    pub explained: f64,
    /// Share of them that cannot be, 0 to 1.
    pub contradicted: f64,
    /// Pieces that the likeliest place explains more than its strongest rival does.
    pub margin_explained: f64,
    /// Pieces that it contradicts less.
    pub margin_contradicted: f64,
    /// Rivals.
    pub rivals: usize,
    /// Distance between the views that are farthest apart, metres.
    pub spread_m: f64,
}

impl PlaceEvidence {
    /// Of `best` against `rivals`.
    pub(crate) fn of<'a>(
        best: &Hypothesis,
        rivals: impl Iterator<Item = &'a Hypothesis>,
        squares: &WallSquares,
        spread_m: f64,
    ) -> Self {
        let here = squares.judged_by(best);
        let walls = here.len().max(1) as f64;
        let margin = |rival: &Hypothesis| {
            let there = squares.judged_by(rival);
            let pairs = || here.iter().zip(&there);
            let explained: f64 = pairs().map(|(here, there)| here.explained - there.explained).sum();
            let contradicted: f64 = pairs().map(|(here, there)| there.contradicted - here.contradicted).sum();
            (explained, contradicted)
        };
        let margins: Vec<(f64, f64)> = rivals.map(margin).collect();
        let least = margins.iter().copied().min_by(|a, b| (a.0 + a.1).total_cmp(&(b.0 + b.1)));
        let (margin_explained, margin_contradicted) = least.unwrap_or((walls, walls));
        Self {
            walls,
            explained: here.iter().map(|square| square.explained).sum::<f64>() / walls,
            contradicted: here.iter().map(|square| square.contradicted).sum::<f64>() / walls,
            margin_explained,
            margin_contradicted,
            rivals: margins.len(),
            spread_m,
        }
    }
}
