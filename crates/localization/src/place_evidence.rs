//! What speaks for a place: how much of what was seen the map explains there, and how much less of
//! it somewhere else.
//!
//! *Somewhere else* is each rival, and the place itself, moved a little. A corridor explains its
//! two walls wherever one stands in it: what it has right a metre farther on as well says nothing.
//! So a place that the map lacks cannot win by walls that are everywhere.

use crate::hypotheses::{Hypothesis, SensedView};
use crate::landmarks::Landmarks;
use crate::votes::{Votes, least};
use crate::wall_squares::WallSquares;
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
    /// Share of them that lie behind a wall of the map, 0 to 1.
    pub too_long: f64,
    /// Pieces of the map's walls that were seen through, against all pieces that were seen.
    pub seen_through: f64,
    /// By how many standard deviations more pieces vote for the place than for its strongest rival,
    /// as if each that votes differently took a side by the toss of a coin. Pieces that are
    /// explained vote for a place, those that cannot be vote against it; those of which the map
    /// knows nothing at the rival count the less the better that is otherwise ([`RivalConfig`]).
    /// Infinite without a rival.
    ///
    /// [`RivalConfig`]: crate::RivalConfig
    pub over_rivals_sigmas: f64,
    /// The same over the place itself, moved by 1 m or 2 m in the direction that costs least.
    pub over_moved_sigmas: f64,
    /// Distance between the views that are farthest apart, metres.
    pub spread_m: f64,
    /// Whether the walls held the newest view there: else the pose is a guess of the odometry.
    pub is_held: bool,
}

/// No more than this share of what was seen is people's.
const MOST_PEOPLE: f64 = 0.33;

impl PlaceEvidence {
    /// What cannot be, against all pieces that were seen.
    #[must_use]
    pub fn contradicted(&self) -> f64 {
        self.too_short + self.too_long
    }

    /// The same where people walk: so many of the pieces that may be people are, at most a third of
    /// all, and no pieces of wall. And the map may have somebody who stood there: whatever he hid,
    /// a piece of wall that was seen through is one that is wrong.
    #[must_use]
    pub fn among_people(self, pieces: f64) -> Self {
        let people = self.somebody.min(pieces.max(0.0) / self.walls.max(1.0)).min(MOST_PEOPLE);
        let others = 1.0 - people;
        Self {
            walls: self.walls * others,
            explained: self.explained / others,
            too_short: (self.too_short - people) / others,
            somebody: (self.somebody - people) / others,
            too_long: self.seen_through / others,
            seen_through: self.seen_through / others,
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
    /// What speaks for `best`, which has these votes and is this far ahead of its rivals.
    pub fn place(&self, best: &Hypothesis, votes: &Votes, over_rivals_sigmas: f64, spread_m: f64) -> PlaceEvidence {
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
            seen_through: self.squares.seen_through(&best.verdicts) / walls,
            over_rivals_sigmas,
            over_moved_sigmas: least(moves.map(|by| votes.sigmas_over(&self.moved(best, &by)))),
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
    fn people_are_no_pieces_of_wall_and_what_they_hid_counts_once() {
        let seen = PlaceEvidence {
            walls: 100.0,
            explained: 0.6,
            too_short: 0.12,
            somebody: 0.1,
            too_long: 0.2,
            seen_through: 0.02,
            ..Default::default()
        };
        let near = |pieces: f64, expected: [f64; 5]| {
            let it = seen.among_people(pieces);
            let found = [it.walls, it.explained, it.too_short, it.somebody, it.too_long];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
            assert!((it.contradicted() - it.too_short - it.too_long).abs() < 1e-12);
        };
        near(0.0, [100.0, 0.6, 0.12, 0.1, 0.02]);
        near(4.0, [96.0, 0.6 / 0.96, 0.08 / 0.96, 0.06 / 0.96, 0.02 / 0.96]);
        near(50.0, [90.0, 0.6 / 0.9, 0.02 / 0.9, 0.0, 0.02 / 0.9]);
        near(-1.0, [100.0, 0.6, 0.12, 0.1, 0.02]);
    }

    #[test]
    fn no_more_than_a_third_is_people() {
        let crowd = PlaceEvidence { walls: 100.0, too_short: 1.0, somebody: 1.0, ..Default::default() };
        let among = crowd.among_people(f64::INFINITY);
        assert!((among.walls - 67.0).abs() < 1e-9 && (among.too_short - 1.0).abs() < 1e-9, "{among:?}");
    }
}
