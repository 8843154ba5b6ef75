//! What all main nodes of a map saw, as one: walls to match to, cells to weigh a pose by, and
//! pictures to search in.

use crate::evidence_grid::{EvidenceGrid, Sighting};
use crate::matching::{BranchAndBoundConfig, ReferenceCloud, SeenPoint, WallPyramid};
use crate::pose::Point2;
use fht_proto::{FixedPoint, Rect};
use std::borrow::Cow;

/// Points of a wall nearer together than this become their mean, metres: two nodes see one wall.
const SPACING_M: f64 = 0.04;

/// The union of all main nodes' scans, map frame.
pub struct ReferenceMap {
    /// To match scans to.
    pub cloud: ReferenceCloud,
    /// To weigh poses by.
    pub known: EvidenceGrid,
    /// To search in; `None` while nothing was seen.
    pub pyramid: Option<WallPyramid>,
}

impl ReferenceMap {
    /// Of what was seen from these places, and the rectangles of free space around all nodes. Of
    /// more than cells and pictures can hold, what is farthest from the middle is left out: a node
    /// that somebody puts a hundred kilometres away hides no building.
    #[must_use]
    pub fn new(sightings: &[Sighting], free: &[(FixedPoint, Rect)], config: &BranchAndBoundConfig) -> Self {
        let holds = |low, high| EvidenceGrid::holds(low, high) && WallPyramid::holds(low, high, config);
        let (sightings, free) = what_fits(sightings, free, holds);
        let mut cloud = ReferenceCloud::default();
        for Sighting { from, ends } in sightings.iter() {
            cloud.absorb(ends.iter().map(|end| SeenPoint::new(*end, *from)), SPACING_M);
        }
        let known = EvidenceGrid::new(&sightings, &free);
        let walls: Vec<Point2> = cloud.positions().collect();
        let places: Vec<Point2> = known.free_places().collect();
        let pyramid = WallPyramid::new(&walls, &places, config);
        Self { cloud, known, pyramid }
    }
}

/// The least and the greatest of all coordinates; `None` of nothing.
fn corners(points: impl IntoIterator<Item = Point2>) -> Option<(Point2, Point2)> {
    points.into_iter().map(|point| (point, point)).reduce(joined)
}

fn joined(a: (Point2, Point2), b: (Point2, Point2)) -> (Point2, Point2) {
    (a.0.inf(&b.0), a.1.sup(&b.1))
}

type Ground<'a> = (Cow<'a, [Sighting]>, Cow<'a, [(FixedPoint, Rect)]>);

/// Everything, if what `holds` it can hold all that lies between the corners of it all; otherwise
/// what is nearest to the middle of where scans were taken. Of the coordinates the median is the
/// middle, which a few nodes far off do not move.
fn what_fits<'a>(
    sightings: &'a [Sighting],
    free: &'a [(FixedPoint, Rect)],
    holds: impl Fn(Point2, Point2) -> bool,
) -> Ground<'a> {
    let point = |(x, y): (f64, f64)| Point2::new(x, y);
    let seen = sightings.iter().filter_map(|seen| corners(seen.ends.iter().chain([&seen.from]).copied()));
    let free_corners = free.iter().map(|(node, rect)| (point(rect.min(*node)), point(rect.max(*node))));
    let parts: Vec<(Point2, Point2)> = seen.chain(free_corners).collect();
    let is_all_held = parts.iter().copied().reduce(joined).is_none_or(|(low, high)| holds(low, high));
    let median = |coordinate: fn(&Sighting) -> f64| {
        let mut all: Vec<f64> = sightings.iter().map(coordinate).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    let (false, Some(x), Some(y)) = (is_all_held, median(|seen| seen.from.x), median(|seen| seen.from.y)) else {
        return (Cow::Borrowed(sightings), Cow::Borrowed(free));
    };
    let middle = Point2::new(x, y);
    let mut order: Vec<usize> = (0..parts.len()).collect();
    let off = |index: usize| (nalgebra::center(&parts[index].0, &parts[index].1) - middle).norm();
    order.sort_by(|a, b| off(*a).total_cmp(&off(*b)));
    let mut is_kept = vec![false; parts.len()];
    let mut held = None;
    for index in order {
        let (low, high) = held.map_or(parts[index], |held| joined(held, parts[index]));
        if holds(low, high) {
            (held, is_kept[index]) = (Some((low, high)), true);
        }
    }
    let (of_sightings, of_free) = is_kept.split_at(sightings.len());
    let kept = sightings.iter().zip(of_sightings).filter(|(_, is_kept)| **is_kept).map(|(seen, _)| seen.clone());
    let kept_free = free.iter().zip(of_free).filter(|(_, is_kept)| **is_kept).map(|(rect, _)| *rect);
    (kept.collect(), kept_free.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square room of side 4 m around a place, seen from there.
    fn room(x: f64, y: f64) -> Sighting {
        let along = (-20..20).map(|step| f64::from(step) * 0.1);
        let walls = along.flat_map(|at| [(at, -2.0), (at, 2.0), (-2.0, at), (2.0, at)]);
        let ends = walls.map(|(east, north)| Point2::new(x + east, y + north)).collect();
        Sighting { from: Point2::new(x, y), ends }
    }

    fn rectangle(x: f64, y: f64) -> (FixedPoint, Rect) {
        (FixedPoint::from_metres(x, y), Rect { west_mm: 500, south_mm: 500, east_mm: 500, north_mm: 500 })
    }

    #[test]
    fn nodes_far_off_hide_no_building() {
        let config = BranchAndBoundConfig::default();
        let rooms = [room(0.0, 0.0), room(10.0, 0.0), room(99_000.0, 5.0)];
        let free = [rectangle(0.0, 0.0), rectangle(-20_000.0, 3_000.0), rectangle(10.0, 0.0), rectangle(0.0, 99_000.0)];
        let map = ReferenceMap::new(&rooms, &free, &config);
        assert!(map.known.is_free(Point2::new(0.3, 0.3)) && map.known.is_wall(Point2::new(12.0, 0.5)));
        assert!(map.pyramid.is_some());
        // As if nobody had put them there.
        let without = ReferenceMap::new(&rooms[..2], &[free[0], free[2]], &config);
        assert_eq!(map.cloud.positions().collect::<Vec<_>>(), without.cloud.positions().collect::<Vec<_>>());
        assert!(map.known.states().eq(without.known.states()));
    }

    #[test]
    fn what_can_be_held_is_held_whole() {
        let rooms = [room(0.0, 0.0), room(300.0, 5.0)];
        let map = ReferenceMap::new(&rooms, &[rectangle(1_000.0, 0.0)], &BranchAndBoundConfig::default());
        assert!(map.known.is_free(Point2::new(1_000.0, 0.0)) && map.known.is_wall(Point2::new(302.0, 5.5)));
    }
}
