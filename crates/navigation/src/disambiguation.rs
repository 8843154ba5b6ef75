//! Where to drive to find out which of several places the robot is at.
//!
//! Two wings of a building may be alike for tens of metres. Wandering finds what differs by luck.
//! The map knows where it is: from some places a robot in the one wing would see what a robot in
//! the other would not. The nearest of them that can be reached whichever candidate is right is
//! worth driving to. Nothing here decides where the robot is: that is for what it then sees.
//!
//! | module | idea |
//! | --- | --- |
//! | `common_ground` | where the robot may drive, whichever candidate is right |
//! | `predicted_view` | what it would see from a place, and how candidates differ in that |
//! | `course` | driving there, and on to the next such place |

mod common_ground;
mod config;
mod course;
mod predicted_view;

pub use config::DisambiguationConfig;
pub use course::DisambiguationCourse;

use self::common_ground::common_ground;
use self::predicted_view::{PredictedView, directions, new_pieces};
use fht_perception::candidate::Candidate;
use fht_perception::evidence_grid::EvidenceGrid;
use fht_perception::grid::{Cell, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2};
use fht_perception::square::{SquareIndex, square_of};
use std::collections::BTreeMap;

/// Places that what was seen so far does not tell apart, on a map.
#[derive(Clone, Copy)]
pub struct Ambiguity<'a> {
    /// What the map knows to be free, and where it has walls; map frame.
    pub known: &'a EvidenceGrid,
    /// The places, most probable first.
    pub candidates: &'a [Candidate],
}

/// What the robot has seen itself, and where it is.
#[derive(Clone, Copy)]
pub struct Surroundings<'a> {
    /// Its live grid, odometry frame.
    pub live: &'a OccupancyGrid,
    /// Where it is.
    pub odom_from_base: &'a Pose2,
    /// How far its scanner reaches, metres.
    pub range_m: f64,
}

/// A place from which candidates can be told apart, and the way there.
#[derive(Clone, Debug, PartialEq)]
pub struct TellingPlace {
    /// From the robot to the place, odometry frame, metres: at least two points.
    pub way: Vec<Point2>,
    /// What the way costs, metres: its length, and more along walls.
    pub way_m: f64,
    /// How much of what is needed to tell the candidates apart a look from there gives, 0 to 1.
    pub told: f64,
}

/// Side of the squares of which one place each is looked at, metres.
const PLACE_SQUARE_M: f64 = 1.0;

/// The square of a place, so that places are remembered and thinned.
fn place_square(place: Point2) -> SquareIndex {
    square_of(place, PLACE_SQUARE_M)
}

/// The place from which the candidates are told apart soonest: the way there, and the looking about
/// there that it takes, are shortest. Squares of which `is_spent` are left out. `None` if there are
/// no two candidates, or none that differ within reach.
#[must_use]
pub fn telling_place(
    ambiguity: &Ambiguity<'_>,
    around: &Surroundings<'_>,
    is_spent: impl Fn(SquareIndex) -> bool,
    config: &DisambiguationConfig,
) -> Option<TellingPlace> {
    let candidates = likely(ambiguity.candidates, config);
    if candidates.len() < 2 {
        return None;
    }
    let here = Point2::from(around.odom_from_base.translation.vector);
    // Most are near, and a small part of a building is searched sooner.
    let reaches_m = [0.5 * config.reach_m, config.reach_m];
    reaches_m.into_iter().find_map(|reach_m| {
        let space = common_ground(ambiguity.known, &candidates, around.live, here, reach_m, config);
        let ways = space.distances_within(here, reach_m);
        let mut places: BTreeMap<SquareIndex, (f64, Cell)> = BTreeMap::new();
        let bounds = space.bounds();
        for index in 0..bounds.width() * bounds.height() {
            let cell = bounds.cell(index);
            let Some(way_m) = ways.distance_m(cell) else { continue };
            let nearest = places.entry(place_square(space.centre(cell))).or_insert((way_m, cell));
            if way_m < nearest.0 {
                *nearest = (way_m, cell);
            }
        }
        let own = place_square(here);
        let mut places: Vec<(f64, Cell)> =
            places.into_iter().filter(|(square, _)| *square != own && !is_spent(*square)).map(|(_, at)| at).collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let each = places.len().div_ceil(config.places.max(1)).max(1);
        let places = places.into_iter().step_by(each).map(|(way_m, cell)| (way_m, space.centre(cell), cell));
        let (way_m, cell, told) = soonest(ambiguity.known, &candidates, around, places, config)?;
        let way = space.shorten(&ways.path_to(cell));
        (way.len() >= 2).then_some(TellingPlace { way, way_m, told })
    })
}

/// The candidates that matter, their shares adding up to 1.
fn likely(candidates: &[Candidate], config: &DisambiguationConfig) -> Vec<Candidate> {
    let least = config.least_share * candidates.iter().map(|candidate| candidate.share).fold(0.0, f64::max);
    let kept = candidates.iter().filter(|candidate| candidate.share >= least && candidate.share > 0.0);
    let mut kept: Vec<Candidate> = kept.take(config.candidates).copied().collect();
    let sum: f64 = kept.iter().map(|candidate| candidate.share).sum();
    kept.iter_mut().for_each(|candidate| candidate.share /= sum);
    kept
}

/// Of places, nearest first, the one that tells soonest: what the way there costs, where it is, and
/// how much it tells.
fn soonest(
    known: &EvidenceGrid,
    candidates: &[Candidate],
    around: &Surroundings<'_>,
    places: impl Iterator<Item = (f64, Point2, Cell)>,
    config: &DisambiguationConfig,
) -> Option<(f64, Cell, f64)> {
    let directions = directions(config.directions);
    let range_m = around.range_m.min(config.range_m);
    let mut best: Option<(f64, (f64, Cell, f64))> = None;
    for (way_m, place, cell) in places {
        let least = way_m + config.look_about_m;
        if best.as_ref().is_some_and(|(cost, _)| *cost <= least) {
            break; // Farther places tell no more than all.
        }
        let views: Vec<PredictedView> = candidates
            .iter()
            .map(|candidate| PredictedView::new(known, candidate, place, &directions, range_m))
            .collect();
        let told = told(
            &views,
            candidates,
            |one, other| {
                let one_way = new_pieces(one, other, place, &directions, around.live, config);
                let other_way = new_pieces(other, one, place, &directions, around.live, config);
                0.5 * (one_way + other_way)
            },
            config,
        );
        if told < config.least_told {
            continue;
        }
        let cost = way_m + config.look_about_m / told;
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            best = Some((cost, (way_m, cell, told)));
        }
    }
    best.map(|(_, place)| place)
}

/// How much of what is needed to tell pairs of candidates apart their views give, on average over
/// pairs, each as probable as both of it are.
fn told(
    views: &[PredictedView],
    candidates: &[Candidate],
    pieces: impl Fn(&PredictedView, &PredictedView) -> f64,
    config: &DisambiguationConfig,
) -> f64 {
    let (mut told, mut all) = (0.0, 0.0);
    for (index, (one, of_one)) in views.iter().zip(candidates).enumerate() {
        for (other, of_other) in views.iter().zip(candidates).skip(index + 1) {
            let weight = of_one.share * of_other.share;
            told += weight * (pieces(one, other) / config.distinct_pieces).min(1.0);
            all += weight;
        }
    }
    told / all
}
