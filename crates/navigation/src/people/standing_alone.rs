//! Narrow things that stand alone: where people walk, each may be somebody who stands.

use super::segments::{ScanSegment, segments};
use fht_perception::frame::LaserScan;

/// What of a scan is no wider than `widest_m` and stands alone: what is beside it is farther by
/// `gap_m`, on both sides, or is somebody before it. `is_somebody` are the beams that people are
/// known to take, by the beam; what such a thing is made of that is not known yet is given back.
#[must_use]
pub fn standing_alone(scan: &LaserScan, is_somebody: &[bool], widest_m: f64, gap_m: f64) -> Vec<ScanSegment> {
    let mut is_taken = is_somebody.to_vec();
    let is_narrow = |it: &ScanSegment| it.width_m(scan) <= widest_m && it.beams().any(|beam| !is_somebody[beam]);
    let mut narrow: Vec<ScanSegment> = segments(scan, gap_m).into_iter().filter(is_narrow).collect();
    let mut alone: Vec<ScanSegment> = Vec::new();
    // Who stands behind somebody is seen beside him: he is found once the other is.
    loop {
        let is_alone = |segment: &ScanSegment| {
            let range_m = |beam: usize| f64::from(scan.ranges_m[beam]);
            let sides = || segment.beside(scan);
            let is_farther = |(beside, own): (usize, usize)| range_m(beside) >= range_m(own) + gap_m;
            let is_free = |(beside, own): (usize, usize)| is_taken[beside] || is_farther((beside, own));
            sides().count() == 2 && sides().all(is_free) && sides().any(is_farther)
        };
        let (found, others): (Vec<ScanSegment>, Vec<ScanSegment>) = narrow.into_iter().partition(is_alone);
        if found.is_empty() {
            return alone;
        }
        found.iter().flat_map(|segment| segment.beams()).for_each(|beam| is_taken[beam] = true);
        alone.extend(found);
        narrow = others;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::Point2;

    /// A room of 8 m by 8 m with people in it, seen from its middle.
    fn room(people: &[Point2]) -> LaserScan {
        LaserScan::all_round(720, |cos, sin| {
            let wall_m = 4.0 / cos.abs().max(sin.abs());
            let met = people.iter().filter_map(|at| {
                let along = at.x * cos + at.y * sin;
                let beside = at.coords.norm_squared() - along * along;
                (along > 0.0 && beside < 0.04).then(|| along - (0.04 - beside).sqrt())
            });
            met.fold(wall_m, f64::min)
        })
    }

    fn count(people: &[Point2]) -> usize {
        let scan = room(people);
        let alone = standing_alone(&scan, &vec![false; scan.ranges_m.len()], 0.6, 0.25);
        alone.iter().map(|segment| segment.beams().count()).sum()
    }

    #[test]
    fn somebody_in_a_room_stands_alone_and_its_walls_do_not() {
        assert_eq!(count(&[]), 0);
        let one = count(&[Point2::new(2.0, 0.0)]);
        assert!((20..26).contains(&one), "{one}: 0.2 m either way at 2 m, two beams a degree, across the seam");
        assert_eq!(count(&[Point2::new(0.0, -2.0)]), one);
    }

    #[test]
    fn who_stands_half_behind_somebody_is_somebody_too() {
        let (front, behind) = (Point2::new(1.5, 0.0), Point2::new(2.5, 0.4));
        let both = count(&[front, behind]);
        assert!(both > count(&[front]) + 6, "{both}");
    }

    #[test]
    fn a_wall_behind_a_door_and_a_corner_do_not_stand_alone() {
        // Through a door of 0.5 m, 2 m ahead, the wall of the next room, 4 m ahead.
        let scan = LaserScan::all_round(720, |cos, sin| {
            let ahead_m = 2.0 / cos;
            let is_door = cos > 0.0 && (ahead_m * sin).abs() < 0.25;
            if is_door { 4.0 / cos } else { 2.0 / cos.abs().max(sin.abs()) }
        });
        assert_eq!(standing_alone(&scan, &[false; 720], 2.0, 0.25), []);
    }
}
