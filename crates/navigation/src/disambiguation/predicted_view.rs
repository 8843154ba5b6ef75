//! What the robot would see from a place if a candidate is right, and what of that would be wrong
//! if another were.

use super::DisambiguationConfig;
use fht_perception::candidate::Candidate;
use fht_perception::evidence_grid::{EvidenceGrid, Sightline};
use fht_perception::grid::{CellState, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_perception::square::{SquareIndex, square_of};
use nalgebra::Vector2;
use std::f64::consts::TAU;

/// Unit vectors, evenly spread around.
pub(super) fn directions(count: usize) -> Vec<Vector2<f64>> {
    let count = count.max(3);
    let direction = |index: usize| {
        let (sin, cos) = (TAU * index as f64 / count as f64).sin_cos();
        Vector2::new(cos, sin)
    };
    (0..count).map(direction).collect()
}

/// How far one sees from a place, by directions of the odometry frame.
pub(super) struct PredictedView {
    lines: Vec<Sightline>,
}

impl PredictedView {
    pub(super) fn new(
        known: &EvidenceGrid,
        candidate: &Candidate,
        place: Point2,
        directions: &[Vector2<f64>],
        range_m: f64,
    ) -> Self {
        let from = candidate.map_from_odom * place;
        let line = |ahead: &Vector2<f64>| known.sightline(from, candidate.map_from_odom.rotation * ahead, range_m);
        Self { lines: directions.iter().map(line).collect() }
    }

    /// How far it is to the left of a direction, in it, and to the right.
    fn beside(&self, index: usize) -> [Sightline; 3] {
        let count = self.lines.len();
        [(index + count - 1) % count, index, (index + 1) % count].map(|index| self.lines[index])
    }
}

/// How many pieces of wall more the candidate of `one` would have right than that of `other`, if it
/// is right. A wall where the other has none counts twice: it is right here and wrong there. What
/// the robot has seen already (`live`) does not count.
pub(super) fn new_pieces(
    one: &PredictedView,
    other: &PredictedView,
    from: Point2,
    directions: &[Vector2<f64>],
    live: &OccupancyGrid,
    config: &DisambiguationConfig,
) -> f64 {
    let mut pieces: Vec<(SquareIndex, u8)> = Vec::new();
    for (index, (line, ahead)) in one.lines.iter().zip(directions).enumerate() {
        if !line.is_wall {
            continue;
        }
        let more = more_right(line.free_m, other.beside(index), config.margin_m);
        let end = from + ahead * line.free_m;
        if more > 0 && !is_seen(live, end) {
            pieces.push((square_of(end, config.square_m), more));
        }
    }
    // Of each piece what it says most clearly.
    pieces.sort_unstable_by(|a, b| b.cmp(a));
    pieces.dedup_by_key(|(square, _)| *square);
    pieces.iter().map(|(_, more)| f64::from(*more)).sum()
}

/// Of a beam that ends at a wall after `range_m`: 0 if there is one where the other view looks,
/// too; 1 if that view does not reach there, 2 if it shows that there is none.
fn more_right(range_m: f64, other: [Sightline; 3], margin_m: f64) -> u8 {
    let nearest = other.iter().map(|line| line.free_m).fold(f64::INFINITY, f64::min);
    let farthest = other.iter().map(|line| line.free_m).fold(0.0, f64::max);
    let is_behind = other.iter().all(|line| line.is_wall) && range_m > farthest + margin_m;
    let is_before = range_m < nearest - margin_m;
    let is_unknown = other.iter().all(|line| !line.is_wall) && range_m > farthest + margin_m;
    if is_behind || is_before { 2 } else { u8::from(is_unknown) }
}

/// Whether the robot has looked at a place: it saw it to be free, or something standing there.
fn is_seen(live: &OccupancyGrid, place: Point2) -> bool {
    /// Walls of the map and of the live grid may be so far apart, metres.
    const ASIDE_M: f64 = 0.1;
    let is_free = live.state_at(place) == CellState::Free;
    let sides = [-ASIDE_M, 0.0, ASIDE_M];
    let mut around = sides.iter().flat_map(|dx| sides.iter().map(move |dy| place + Vector2::new(*dx, *dy)));
    is_free || around.any(|place| live.state_at(place) == CellState::Occupied)
}
