//! What a main node's scanner saw, in the map frame: where its beams ended, and the ground that
//! they passed over.

use crate::crdt::state::NodeRef;
use crate::navmesh::plane::{Corner, between, corner_of, cross, distance, nearest_on};

/// A beam passed over ground that is this much nearer than its end, millimetres.
const BEFORE_END_MM: f64 = 50.0;
/// And over ground that is at most this far beside it: beams farther apart leave what is between
/// them unseen, millimetres.
const BESIDE_MM: f64 = 100.0;
/// Beams side by side hit one thing if their ranges differ by less, millimetres.
const DEPTH_MM: f64 = 100.0;

/// Between ends of beams side by side that are nearer than this there is no way for a robot,
/// millimetres.
pub(crate) const ONE_THING_MM: f64 = 150.0;
/// Between ends of beams that are farther apart than this no wall is supposed, millimetres: less
/// than the width of a door.
pub(crate) const WALL_GAP_MM: f64 = 600.0;
/// A wall goes straight on if the next end lies this near to its line, millimetres.
const BENT_MM: f64 = 40.0;

/// A node's position, millimetres, and heading, radians, may be off by this much: whether a beam
/// hit a chair's leg or went past it can be told from near only.
const OFF_MM: f64 = 5.0;
const OFF_RAD: f64 = 0.003;
/// It ended this much farther away: nothing stands there, millimetres.
const BEHIND_MM: f64 = 200.0;

/// One node's scan where it was taken.
#[derive(Clone, Debug)]
pub(crate) struct Visibility {
    /// The scanner, millimetres in the map frame.
    pub(crate) from: Corner,
    /// Heading of the first beam, radians in the map frame.
    first_angle: f64,
    /// Angle from a beam to the next, radians.
    step: f64,
    /// Ranges, millimetres; 0 where nothing returned.
    ranges_mm: Vec<u16>,
}

impl Visibility {
    /// A main node's; `None` for a node without a scan.
    pub(crate) fn of(node: &NodeRef<'_>) -> Option<Self> {
        let scan = &node.signature?.scan;
        let (at, yaw, mount) = (node.pose.position, node.pose.yaw(), scan.base_from_sensor);
        let (sin, cos) = yaw.sin_cos();
        let ([x0, y0], [x, y]) = (corner_of(at), corner_of(mount.position));
        Some(Self {
            from: [x0 + x * cos - y * sin, y0 + x * sin + y * cos],
            first_angle: yaw + mount.yaw() + f64::from(scan.angle_min),
            step: f64::from(scan.angle_increment),
            ranges_mm: scan.ranges_mm.clone(),
        })
    }

    /// How many beams it has.
    pub(crate) fn beams(&self) -> usize {
        self.ranges_mm.len()
    }

    /// The ends of its beams that returned, with the beams' numbers.
    pub(crate) fn ends(&self) -> impl Iterator<Item = (usize, Corner)> + '_ {
        (0..self.ranges_mm.len()).filter_map(|beam| Some((beam, self.end(beam)?)))
    }

    fn end(&self, beam: usize) -> Option<Corner> {
        let range_mm = self.ranges_mm.get(beam).copied().filter(|range| *range > 0).map(f64::from)?;
        let (sin, cos) = (self.first_angle + beam as f64 * self.step).sin_cos();
        Some([self.from[0] + range_mm * cos, self.from[1] + range_mm * sin])
    }

    /// How wide the thing is that a beam hit, millimetres: as far as the beams beside it ended on
    /// it as well, looking at most `most_mm` to either side.
    pub(crate) fn width_mm(&self, beam: usize, most_mm: f64) -> f64 {
        let Some(at) = self.end(beam) else { return 0.0 };
        let count = self.ranges_mm.len();
        let reach = |next: &dyn Fn(usize) -> Option<usize>| {
            let (mut beam, mut reach_mm) = (beam, 0.0);
            for _ in 1..count {
                let Some((beside, end)) = next(beam).and_then(|beside| Some((beside, self.end(beside)?))) else {
                    break;
                };
                let deeper_mm = f64::from(self.ranges_mm[beside]) - f64::from(self.ranges_mm[beam]);
                let away_mm = distance(end, at);
                if deeper_mm.abs() >= DEPTH_MM || away_mm >= most_mm {
                    break;
                }
                (beam, reach_mm) = (beside, away_mm.max(reach_mm));
            }
            reach_mm
        };
        reach(&|beam| self.before(beam)) + reach(&|beam| self.after(beam)) + self.spacing_mm(at)
    }

    /// The beam before one, and after one; of a full turn the last and the first stand side by
    /// side.
    fn before(&self, beam: usize) -> Option<usize> {
        if beam == 0 && self.is_full() { self.ranges_mm.len().checked_sub(1) } else { beam.checked_sub(1) }
    }

    fn after(&self, beam: usize) -> Option<usize> {
        Some(if beam + 1 == self.ranges_mm.len() && self.is_full() { 0 } else { beam + 1 })
    }

    /// The wall that a beam and the one after it ended on, from end to end: they are near together,
    /// or on one straight line with a beam beside them. None where either ended elsewhere, or
    /// nowhere.
    pub(crate) fn wall_after(&self, beam: usize) -> Option<[Corner; 2]> {
        let next = self.after(beam)?;
        let line = [self.end(beam)?, self.end(next)?];
        let length_mm = distance(line[0], line[1]);
        let goes_on = |beside: Option<usize>| {
            beside.and_then(|beside| self.end(beside)).is_some_and(|end| {
                let beside_mm = cross(line[0], line[1], end).abs() / length_mm.max(1.0);
                beside_mm <= BENT_MM && distance(nearest_on(line, end), end) <= WALL_GAP_MM
            })
        };
        let is_wall = length_mm <= ONE_THING_MM
            || length_mm <= WALL_GAP_MM && (goes_on(self.before(beam)) || goes_on(self.after(next)));
        is_wall.then_some(line)
    }

    /// Whether the last beam of a full turn has the first one after it.
    fn is_full(&self) -> bool {
        let turn = self.ranges_mm.len() as f64 * self.step.abs();
        (turn - std::f64::consts::TAU).abs() < 0.5 * self.step.abs()
    }

    /// Whether the beam nearest to a place passed over it.
    pub(crate) fn is_passed(&self, place: Corner) -> bool {
        let beam = self.nearest_beam(place);
        beam.is_some_and(|it| it.beside_mm.abs() <= BESIDE_MM && it.away_mm + BEFORE_END_MM < it.range_mm)
    }

    /// Whether a beam went through a place as if nothing of that half width were there.
    pub(crate) fn denies(&self, place: Corner, half_width_mm: f64) -> bool {
        let goes_through = |beam: Beam| {
            let off_mm = beam.beside_mm.abs() + OFF_MM + OFF_RAD * beam.away_mm;
            off_mm < half_width_mm && beam.away_mm + BEHIND_MM < beam.range_mm
        };
        self.nearest_beam(place).is_some_and(goes_through)
    }

    /// How far apart beams are at a place, millimetres.
    fn spacing_mm(&self, place: Corner) -> f64 {
        self.step.abs() * distance(self.from, place)
    }

    /// The place behind another as seen from here.
    pub(crate) fn behind(&self, place: Corner, by_mm: f64) -> Corner {
        let away_mm = distance(self.from, place).max(1.0);
        between([self.from, place], 1.0 + by_mm / away_mm)
    }

    fn nearest_beam(&self, place: Corner) -> Option<Beam> {
        let (dx, dy) = (place[0] - self.from[0], place[1] - self.from[1]);
        let turn = (dy.atan2(dx) - self.first_angle) * self.step.signum();
        let beams = turn.rem_euclid(std::f64::consts::TAU) / self.step.abs();
        let index = beams.round();
        let is_first_again = index == self.ranges_mm.len() as f64 && self.is_full();
        let range_mm = f64::from(*self.ranges_mm.get(if is_first_again { 0 } else { index as usize })?);
        let away_mm = dx.hypot(dy);
        Some(Beam { range_mm, away_mm, beside_mm: (beams - index) * self.step.abs() * away_mm })
    }
}

/// The beam nearest to a place.
struct Beam {
    /// How far it went, millimetres; 0 if nothing returned.
    range_mm: f64,
    /// How far away the place is, millimetres.
    away_mm: f64,
    /// How far beside the beam the place is, millimetres.
    beside_mm: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From the origin, a beam each degree from `first`, degrees, on; ranges in millimetres.
    fn view(first: f64, ranges_mm: Vec<u16>) -> Visibility {
        Visibility { from: [0.0, 0.0], first_angle: first.to_radians(), step: 1.0_f64.to_radians(), ranges_mm }
    }

    fn at(degrees: f64, mm: f64) -> Corner {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [mm * cos, mm * sin]
    }

    #[test]
    fn nothing_is_seen_beside_a_scan_of_part_of_a_turn() {
        let part = view(-135.0, vec![4000; 271]);
        assert!(part.is_passed(at(134.9, 2000.0)) && part.is_passed(at(-135.0, 2000.0)));
        assert!(!part.is_passed(at(136.0, 2000.0)) && !part.is_passed(at(-136.0, 2000.0)));
        let whole = view(0.0, vec![4000; 360]);
        assert!(whole.is_passed(at(359.7, 2000.0)));
    }

    #[test]
    fn ground_between_beams_far_apart_is_not_seen() {
        let view = Visibility { step: 10.0_f64.to_radians(), ..view(0.0, vec![8000; 36]) };
        assert!(view.is_passed(at(10.0, 4000.0)) && !view.is_passed(at(5.0, 4000.0)));
    }

    #[test]
    fn a_thing_is_as_wide_as_the_beams_that_hit_it() {
        let mut ranges = vec![2200; 360];
        ranges[0..2].fill(2000);
        ranges[358..].fill(2000);
        let width_mm = view(0.0, ranges).width_mm(0, 300.0);
        // Four beams, 35 mm apart.
        assert!((139.0..141.0).contains(&width_mm), "{width_mm}");
    }
}
