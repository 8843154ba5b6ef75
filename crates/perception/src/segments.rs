//! Returns of a scan that hang together: those side by side whose ranges differ by little.

use crate::frame::LaserScan;
use std::f64::consts::TAU;

/// Beams in a whole turn, in parts.
#[must_use]
pub fn beams_in_turn(scan: &LaserScan) -> f64 {
    /// A scanner's word of its step may be 0.
    const LEAST_STEP_RAD: f64 = 1e-6;
    TAU / scan.angle_increment.abs().max(LEAST_STEP_RAD)
}

/// Whether the scanner looks all round: beside its last beam is its first.
#[must_use]
pub fn is_all_round(scan: &LaserScan) -> bool {
    (scan.ranges_m.len() as f64 - beams_in_turn(scan)).abs() < 1.5
}

/// Returns of a scan that hang together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanSegment {
    first: usize,
    /// How many returns.
    pub(crate) count: usize,
    /// Beams of the scan.
    of: usize,
}

impl ScanSegment {
    /// How many returns.
    #[must_use]
    pub fn count(self) -> usize {
        self.count
    }

    /// The numbers of its beams, side by side.
    pub fn beams(self) -> impl Iterator<Item = usize> {
        (self.first..self.first + self.count).map(move |beam| beam % self.of)
    }

    /// How far its returns reach from the first of them, metres: its width, but for what lies all
    /// round.
    #[must_use]
    pub fn width_m(self, scan: &LaserScan) -> f64 {
        let first = scan.beam_end_in_base(self.first);
        self.beams().map(|beam| (scan.beam_end_in_base(beam) - first).norm()).fold(0.0, f64::max)
    }

    /// The beams beside it, each with that of its own that is next to it; none at an end of a scan
    /// that does not look all round.
    pub fn beside(self, scan: &LaserScan) -> impl Iterator<Item = (usize, usize)> {
        let last = (self.first + self.count - 1) % self.of;
        let is_round = is_all_round(scan);
        let before = if self.first > 0 { Some(self.first - 1) } else { Some(self.of - 1).filter(|_| is_round) };
        let after = if last + 1 < self.of { Some(last + 1) } else { Some(0).filter(|_| is_round) };
        let sides = before.map(|beam| (beam, self.first)).into_iter().chain(after.map(|beam| (beam, last)));
        sides.filter(move |_| self.count < self.of)
    }
}

/// The returns of a scan, as they hang together: ranges side by side differ by less than `gap_m`.
#[must_use]
pub fn segments(scan: &LaserScan, gap_m: f64) -> Vec<ScanSegment> {
    let (ranges, of) = (&scan.ranges_m, scan.ranges_m.len());
    let hangs = |one: usize, other: usize| {
        let step_m = f64::from(ranges[one]) - f64::from(ranges[other]);
        scan.is_return(ranges[one]) && scan.is_return(ranges[other]) && step_m.abs() < gap_m
    };
    let mut found: Vec<ScanSegment> = Vec::new();
    for beam in (0..of).filter(|beam| scan.is_return(ranges[*beam])) {
        match found.last_mut() {
            Some(segment) if segment.first + segment.count == beam && hangs(beam - 1, beam) => segment.count += 1,
            _ => found.push(ScanSegment { first: beam, count: 1, of }),
        }
    }
    // All round, the last may go on as the first.
    if found.len() > 1 && is_all_round(scan) && hangs(of - 1, 0) {
        let first = found.remove(0);
        if let Some(last) = found.last_mut() {
            last.count += first.count;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(ranges_m: &[f32], step_deg: f64) -> Vec<(usize, usize)> {
        let mut scan = LaserScan::all_round(4, |_, _| 1.0);
        (scan.ranges_m, scan.angle_increment) = (ranges_m.to_vec(), step_deg.to_radians());
        segments(&scan, 0.25).into_iter().map(|segment| (segment.first, segment.count)).collect()
    }

    #[test]
    fn what_lies_side_by_side_hangs_together_across_the_seam_too() {
        let nothing = f32::INFINITY;
        let ranges = [1.0, 1.1, nothing, 2.0, 3.0, 3.1, 3.2, 1.05];
        assert_eq!(found(&ranges, 45.0), [(3, 1), (4, 3), (7, 3)], "all round");
        assert_eq!(found(&ranges, 20.0), [(0, 2), (3, 1), (4, 3), (7, 1)], "not all round");
        assert_eq!(found(&[1.0; 8], 45.0), [(0, 8)]);
        assert_eq!(found(&[nothing; 8], 45.0), []);
        assert_eq!(found(&[], 45.0), []);
    }

    #[test]
    fn a_room_is_wide_though_its_ends_meet() {
        let width_m = |scan: &LaserScan| segments(scan, 0.25).iter().map(|it| it.width_m(scan)).fold(0.0, f64::max);
        let room = LaserScan::all_round(360, |cos, sin| 2.0 / cos.abs().max(sin.abs()));
        assert!(width_m(&room) > 4.0);
        let door = LaserScan::all_round(360, |cos, sin| if cos > 0.99 { 7.0 } else { 2.0 / cos.abs().max(sin.abs()) });
        assert!(width_m(&door) > 3.0);
    }

    #[test]
    fn beside_it_are_the_beams_next_to_its_ends() {
        let scan = LaserScan::all_round(8, |cos, _| if cos > 0.9 { 1.0 } else { 3.0 });
        let sides = |segment: &ScanSegment| segment.beside(&scan).collect::<Vec<_>>();
        let found = segments(&scan, 0.25);
        assert_eq!(found.iter().map(sides).collect::<Vec<_>>(), [[(7, 0), (1, 0)], [(0, 1), (0, 7)]]);
        let wall = LaserScan::all_round(8, |_, _| 2.0);
        assert!(segments(&wall, 0.25).iter().all(|segment| segment.beside(&wall).count() == 0));
    }
}
