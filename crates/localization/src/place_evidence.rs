//! What speaks for a place: how much of what was seen the map explains there, and how much less of
//! it somewhere else.
//!
//! *Somewhere else* is each rival, and the place itself, moved a little. A corridor explains its
//! two walls wherever one stands in it: what it has right a metre farther on as well says nothing.
//! So a place that the map lacks cannot win by walls that are everywhere.

use crate::hypotheses::{Hypothesis, SensedView};
use crate::landmarks::Landmarks;
use crate::wall_squares::{Votes, WallSquares};
use fht_perception::evidence_grid::{BeamVerdict, EvidenceConfig};
use fht_perception::pose::{Pose2, pose};
use std::f64::consts::FRAC_PI_4;

/// How far the place is moved, metres.
const MOVES_M: [f64; 2] = [1.0, 2.0];

/// What speaks for the likeliest place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlaceEvidence {
    /// Pieces of wall that were seen.
    pub walls: f64,
    /// Share of them that the map explains, 0 to 1.
    pub explained: f64,
    /// Share of them that stand where the map is free, 0 to 1.
    pub too_short: f64,
    /// Share of them that do, are narrow and stand alone: they may be people. 0 to 1.
    pub somebody: f64,
    /// Pieces of the map's walls that were seen through, against all that were seen.
    pub too_long: f64,
    /// By how many standard deviations more pieces vote for the place than for its strongest rival,
    /// as if each that votes differently took a side by the toss of a coin. Pieces that are
    /// explained vote for a place, those that cannot be vote against it. Infinite without a rival.
    pub over_rivals_sigmas: f64,
    /// The same over the place itself, moved by 1 m or 2 m in the direction that costs least.
    pub over_moved_sigmas: f64,
    /// Distance between the views that are farthest apart, metres.
    pub spread_m: f64,
    /// Whether the walls held the newest view there: else the pose is a guess of the odometry.
    pub is_held: bool,
}

impl PlaceEvidence {
    /// What cannot be, against all pieces that were seen.
    #[must_use]
    pub fn contradicted(&self) -> f64 {
        self.too_short + self.too_long
    }

    /// The same if so many of the pieces that may be people are: they are no pieces of wall then.
    #[must_use]
    pub fn among_people(self, pieces: f64) -> Self {
        let people = self.somebody.min(pieces / self.walls.max(1.0));
        let others = 1.0 - people;
        if others <= 0.0 {
            return Self { walls: 0.0, explained: 0.0, too_short: 0.0, somebody: 0.0, ..self };
        }
        Self {
            walls: self.walls * others,
            explained: self.explained / others,
            too_short: (self.too_short - people) / others,
            somebody: (self.somebody - people) / others,
            too_long: self.too_long / others,
            ..self
        }
    }
}

/// By what a place is judged.
pub(crate) struct Judged<'a> {
    pub views: &'a [SensedView],
    pub squares: &'a WallSquares,
    pub landmarks: &'a Landmarks,
    pub evidence: &'a EvidenceConfig,
}

impl Judged<'_> {
    /// What speaks for `best`, which has these votes, against rivals that have those.
    pub fn place<'a>(
        &self,
        best: &Hypothesis,
        votes: &Votes,
        rivals: impl Iterator<Item = &'a Votes>,
        spread_m: f64,
    ) -> PlaceEvidence {
        let here = self.squares.tally(&best.verdicts);
        let directions = (0..8).map(|eighth| FRAC_PI_4 * f64::from(eighth));
        let moves = directions.flat_map(|angle| MOVES_M.map(|m| pose(m * angle.cos(), m * angle.sin(), 0.0)));
        let walls = (self.squares.count as f64).max(1.0);
        PlaceEvidence {
            walls,
            explained: here.explained / walls,
            too_short: (here.too_short + here.somebody) / walls,
            somebody: here.somebody / walls,
            too_long: here.too_long / walls,
            over_rivals_sigmas: votes.least_sigmas_over(rivals),
            over_moved_sigmas: votes.least_sigmas_over(moves.map(|by| self.moved(best, &by))),
            spread_m,
            is_held: best.is_held,
        }
    }

    /// What the place says if it is moved on the map.
    fn moved(&self, place: &Hypothesis, by: &Pose2) -> Votes {
        let known = &self.landmarks.walls().known;
        let views = place.at.iter().zip(self.views);
        let verdicts: Vec<Vec<Option<BeamVerdict>>> =
            views.map(|(at, view)| known.judge(&view.beams, &(by * at), self.evidence)).collect();
        self.squares.votes(&verdicts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_are_no_pieces_of_wall() {
        let seen =
            PlaceEvidence { walls: 100.0, explained: 0.72, too_short: 0.12, somebody: 0.1, ..Default::default() };
        let near = |it: PlaceEvidence, expected: [f64; 4]| {
            let found = [it.walls, it.explained, it.too_short, it.somebody];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        assert_eq!(seen.among_people(0.0), seen);
        near(seen.among_people(4.0), [96.0, 0.75, 0.08 / 0.96, 0.06 / 0.96]);
        near(seen.among_people(50.0), [90.0, 0.8, 0.02 / 0.9, 0.0]);
        let all = PlaceEvidence { explained: 0.0, too_short: 1.0, somebody: 1.0, ..seen };
        near(all.among_people(200.0), [0.0; 4]);
    }
}
