//! Where the robot may drive, whichever candidate is right: what it has seen to be free, and beyond
//! that what the map has as free for most of them. What it has seen to be taken is taken.

use super::DisambiguationConfig;
use crate::planning::Traversable;
use fht_perception::candidate::Candidate;
use fht_perception::evidence_grid::EvidenceGrid;
use fht_perception::grid::{Cell, CellBounds, CellState, OccupancyGrid};
use fht_perception::pose::{Point2, Pose2};
use nalgebra::Vector2;

/// The ground within `reach_m` of `here` along each axis, odometry frame, as far as the map or the
/// live grid has any.
pub(super) fn common_ground(
    known: &EvidenceGrid,
    candidates: &[Candidate],
    live: &OccupancyGrid,
    here: Point2,
    reach_m: f64,
    config: &DisambiguationConfig,
) -> Traversable {
    let side_m = known.resolution_m();
    let reach = Vector2::repeat(reach_m);
    let (mut low, mut high) = extent(known, candidates, live);
    (low, high) = (low.sup(&(here - reach)), high.inf(&(here + reach)));
    let cell = |place: Point2| Cell { i: (place.x / side_m).floor() as i32, j: (place.y / side_m).floor() as i32 };
    let (min, last) = (cell(low), cell(high));
    let max = Cell { i: last.i.saturating_add(1).max(min.i), j: last.j.saturating_add(1).max(min.j) };
    let bounds = CellBounds { min, max };
    let places: Vec<(Pose2, f64)> = candidates.iter().map(|of| (of.map_from_odom, of.share)).collect();
    let centre = |index: i32| (f64::from(index) + 0.5) * side_m;
    let mut states = Vec::with_capacity(bounds.width() * bounds.height());
    for j in min.j..max.j {
        states.extend((min.i..max.i).map(|i| {
            let place = Point2::new(centre(i), centre(j));
            match seen(live, place, side_m) {
                CellState::Unknown => supposed(known, &places, place, config.agreement),
                state => state,
            }
        }));
    }
    Traversable::from_states(&states, bounds, side_m, &config.plan)
}

/// The corners of all that the map, as the most probable candidate has it, and the live grid know.
fn extent(known: &EvidenceGrid, candidates: &[Candidate], live: &OccupancyGrid) -> (Point2, Point2) {
    let bounds = live.bounds();
    let mut corners = vec![live.centre(bounds.min), live.centre(bounds.max)];
    if let Some(first) = candidates.first() {
        let odom_from_map = first.map_from_odom.inverse();
        let size = Vector2::new(known.width() as f64, known.height() as f64) * known.resolution_m();
        let of_map = [(0.0, 0.0), (size.x, 0.0), (0.0, size.y), (size.x, size.y)];
        corners.extend(of_map.map(|(x, y)| odom_from_map * (known.origin() + Vector2::new(x, y))));
    }
    let low = corners.iter().fold(Point2::new(f64::MAX, f64::MAX), |low, corner| low.inf(corner));
    let high = corners.iter().fold(Point2::new(f64::MIN, f64::MIN), |high, corner| high.sup(corner));
    (low, high)
}

/// What the robot saw of a cell of this side itself: its own cells may be smaller.
fn seen(live: &OccupancyGrid, centre: Point2, side_m: f64) -> CellState {
    let aside = 0.25 * side_m;
    let mut state = CellState::Unknown;
    for (dx, dy) in [(-aside, -aside), (aside, -aside), (-aside, aside), (aside, aside)] {
        match live.state_at(centre + Vector2::new(dx, dy)) {
            CellState::Occupied => return CellState::Occupied,
            CellState::Free => state = CellState::Free,
            CellState::Unknown => {}
        }
    }
    state
}

/// What the candidates have there.
fn supposed(known: &EvidenceGrid, places: &[(Pose2, f64)], place: Point2, agreement: f64) -> CellState {
    let (mut free, mut wall) = (0.0, 0.0);
    for (map_from_odom, share) in places {
        let on_map = map_from_odom * place;
        if known.is_wall(on_map) {
            wall += share;
        } else if known.is_free(on_map) {
            free += share;
        }
    }
    // Shares that add up to 1 do so but for their last digits.
    let most = 1.0 + 1e-9;
    if wall > most - agreement {
        CellState::Occupied
    } else if free * most >= agreement {
        CellState::Free
    } else {
        CellState::Unknown
    }
}
