//! Narrow things that stand alone in a scan: where people walk, each may be somebody who stands.

use crate::frame::LaserScan;
use crate::segments::{ScanSegment, segments};

/// What counts as a thing that stands alone.
#[derive(Clone, Copy, Debug)]
pub struct StandingAlone {
    /// It is at most this wide, metres. Default 0.6.
    pub widest_m: f64,
    /// What is beside it is farther by at least this, metres. Returns side by side hang together
    /// when their ranges differ by less. Default 0.25.
    pub gap_m: f64,
    /// So many returns at least: single ones are edges, and walls seen along. Default 3.
    pub least_returns: usize,
}

impl Default for StandingAlone {
    fn default() -> Self {
        Self { widest_m: 0.6, gap_m: 0.25, least_returns: 3 }
    }
}

/// What of a scan is narrow and stands alone: on both sides what is beside it is farther, or
/// nothing returned or is known there, or somebody stands before it. `is_somebody` says of each
/// beam whether it is known to end at somebody; beams that it lacks do not.
#[must_use]
pub fn standing_alone(scan: &LaserScan, is_somebody: &[bool], config: &StandingAlone) -> Vec<ScanSegment> {
    let mut is_taken = is_somebody.to_vec();
    is_taken.resize(scan.ranges_m.len(), false);
    let is_narrow = |it: &ScanSegment| it.count >= config.least_returns && it.width_m(scan) <= config.widest_m;
    let mut narrow: Vec<ScanSegment> = segments(scan, config.gap_m).into_iter().filter(is_narrow).collect();
    let mut alone: Vec<ScanSegment> = Vec::new();
    // Who stands behind somebody is seen beside him: he is found once the other is.
    loop {
        let is_alone = |segment: &ScanSegment| {
            let range_m = |beam: usize| f64::from(scan.ranges_m[beam]);
            let sides = || segment.beside(scan);
            // Of NaN nothing is known, and nothing may be there.
            let is_nearer = |beside: usize, own: usize| range_m(beside) < range_m(own) + config.gap_m;
            let is_open = |(beside, own): (usize, usize)| !is_taken[beside] && !is_nearer(beside, own);
            let is_free = |(beside, own): (usize, usize)| is_taken[beside] || !is_nearer(beside, own);
            sides().count() == 2 && sides().all(is_free) && sides().any(is_open)
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
    use crate::pose::Point2;

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
        let alone = standing_alone(&room(people), &[], &StandingAlone::default());
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
    fn who_stands_before_open_space_stands_alone_whatever_the_scanner_says_of_that() {
        let one = |nothing: f32| {
            let mut scan = room(&[Point2::new(2.0, 0.5)]);
            scan.ranges_m.iter_mut().filter(|range_m| **range_m > 3.0).for_each(|range_m| *range_m = nothing);
            standing_alone(&scan, &[], &StandingAlone::default()).len()
        };
        assert_eq!([f32::INFINITY, 9.0, f32::NAN].map(one), [1; 3]);
    }

    #[test]
    fn who_hides_behind_somebody_who_is_known_stands_alone() {
        let (front, behind) = (Point2::new(1.5, 0.0), Point2::new(2.5, 0.4));
        let mut scan = room(&[front, behind]);
        let is_front: Vec<bool> = scan.ranges_m.iter().map(|range_m| *range_m < 1.6).collect();
        assert_eq!(
            standing_alone(&scan, &is_front, &StandingAlone::default()).len(),
            2,
            "he is a thing that stands alone himself"
        );
        scan.ranges_m.iter_mut().filter(|range_m| **range_m < 1.6).for_each(|range_m| *range_m = f32::NAN);
        assert_eq!(standing_alone(&scan, &[], &StandingAlone::default()).len(), 1, "hidden before");
    }

    #[test]
    fn a_wall_that_is_seen_along_does_not_stand_alone_behind_somebody() {
        // A corridor 2 m wide, and somebody near its left wall.
        let somebody = Point2::new(5.0, 0.7);
        let mut scan = LaserScan::all_round(2000, |_, sin| 1.0 / sin.abs().max(1e-9));
        scan.range_max_m = 30.0;
        let corridor = scan.clone();
        for beam in 0..2000 {
            let (sin, cos) = scan.angle(beam).sin_cos();
            let along = somebody.x * cos + somebody.y * sin;
            let beside = somebody.coords.norm_squared() - along * along;
            if along > 0.0 && beside < 0.04 {
                scan.ranges_m[beam] = (along - (0.04 - beside).sqrt()) as f32;
            }
        }
        let alone = standing_alone(&scan, &[], &StandingAlone::default());
        let is_wall = |beam: usize| scan.ranges_m[beam] == corridor.ranges_m[beam];
        let wall = alone.iter().flat_map(|thing| thing.beams()).filter(|beam| is_wall(*beam)).count();
        assert!(alone.len() == 1 && wall == 0, "{} things, {wall} beams of wall", alone.len());
    }

    #[test]
    fn a_wall_behind_a_door_does_not_stand_alone() {
        // Through a door of 0.5 m, 2 m ahead, the wall of the next room, 4 m ahead.
        let scan = LaserScan::all_round(720, |cos, sin| {
            let ahead_m = 2.0 / cos;
            let is_door = cos > 0.0 && (ahead_m * sin).abs() < 0.25;
            if is_door { 4.0 / cos } else { 2.0 / cos.abs().max(sin.abs()) }
        });
        assert_eq!(standing_alone(&scan, &[], &StandingAlone { widest_m: 2.0, ..StandingAlone::default() }), []);
    }
}
