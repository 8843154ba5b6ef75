//! How much of what a robot sees the main nodes' scans know already. Where they know little nobody
//! can find itself by them, however near they are: a node on the other side of a wall has seen
//! nothing of this side.

use fht_map::MapState;
use fht_perception::frame::LaserScan;
use fht_perception::pose::{Point2, Pose2, from_fixed, to_fixed};
use fht_perception::square::{SquareIndex, square_of};
use fht_proto::{FixedPoint, ScanRecord};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashSet};

/// A return is known when a node's beam ends in its square of this side or in one beside it,
/// metres.
const SQUARE_M: f64 = 0.1;
/// Nodes within this are asked, metres: twice the range of the paper's scanner.
const REACH_M: f64 = 14.0;

fn square(point: Point2) -> SquareIndex {
    square_of(point, SQUARE_M)
}

/// Where the beams of some scans end.
#[derive(Clone, Debug, Default)]
pub struct ScanCoverage(HashSet<SquareIndex>);

impl ScanCoverage {
    /// What the main nodes within `reach_m` of a place know.
    #[must_use]
    pub fn of(state: &MapState, here: FixedPoint, reach_m: f64) -> Self {
        let mut known = Self::default();
        for node in state.main_nodes().filter(|node| node.pose.position.distance(here) <= reach_m) {
            if let Some(signature) = node.signature {
                known.add(&squares(&from_fixed(node.pose), &signature.scan));
            }
        }
        known
    }

    fn add(&mut self, squares: &[SquareIndex]) {
        self.0.extend(squares);
    }

    fn has(&self, (i, j): SquareIndex) -> bool {
        (i - 1..=i + 1).any(|i| (j - 1..=j + 1).any(|j| self.0.contains(&(i, j))))
    }
}

/// The squares in which the beams of a scan end.
fn squares(map_from_base: &Pose2, scan: &ScanRecord) -> Vec<SquareIndex> {
    let mut squares: Vec<SquareIndex> =
        LaserScan::record_points_in_base(scan).iter().map(|end| square(map_from_base * end)).collect();
    squares.sort_unstable();
    squares.dedup();
    squares
}

/// The share of what a scan, taken at `map_from_base`, sees that the scans of the map's main nodes
/// know. All of it if nothing returned.
#[must_use]
pub fn known_share(state: &MapState, map_from_base: &Pose2, scan: &ScanRecord) -> f64 {
    let known = ScanCoverage::of(state, to_fixed(map_from_base).position, REACH_M);
    let seen = squares(map_from_base, scan);
    if seen.is_empty() {
        return 1.0;
    }
    seen.iter().filter(|square| known.has(**square)).count() as f64 / seen.len() as f64
}

/// Of scans and where they were taken, those that add most to what is known, always the one that
/// adds most first, until none adds `least_m` of wall. Returns their places in `seen`.
#[must_use]
pub fn most_telling(mut known: ScanCoverage, seen: &[(Pose2, &ScanRecord)], least_m: f64) -> Vec<usize> {
    let squares: Vec<Vec<SquareIndex>> =
        seen.iter().map(|(map_from_base, scan)| squares(map_from_base, scan)).collect();
    let news = |known: &ScanCoverage, index: usize| squares[index].iter().filter(|square| !known.has(**square)).count();
    let least = (least_m / SQUARE_M).ceil().max(1.0) as usize;
    // What a scan adds only ever falls: it is counted again when it comes first, and stays first if
    // it still adds most.
    let mut waiting: BinaryHeap<(usize, Reverse<usize>)> =
        (0..seen.len()).map(|index| (news(&known, index), Reverse(index))).collect();
    let mut told = Vec::new();
    while let Some((bound, Reverse(index))) = waiting.pop().filter(|(bound, _)| *bound >= least) {
        let now = news(&known, index);
        if now == bound {
            known.add(&squares[index]);
            told.push(index);
        } else {
            waiting.push((now, Reverse(index)));
        }
    }
    told
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;
    use fht_proto::{AuthorId, Increment, NodeId, NodeKind, Op, Signature};

    /// What is seen from `x` metres along a corridor that is 2 m wide and 6 m long, with a wall
    /// across it at 3 m if `is_split`.
    fn seen_from(x: f64, is_split: bool) -> ScanRecord {
        let (low, high) = if !is_split {
            (0.0, 6.0)
        } else if x < 3.0 {
            (0.0, 3.0)
        } else {
            (3.1, 6.0)
        };
        let range_m = |beam: u16| {
            let (sin, cos) = f64::from(beam).to_radians().sin_cos();
            let along = if cos > 0.0 { (high - x) / cos } else { (x - low) / -cos.min(-1e-9) };
            along.min(1.0 / sin.abs().max(1e-9))
        };
        ScanRecord {
            base_from_sensor: to_fixed(&Pose2::identity()),
            angle_min: 0.0,
            angle_increment: 1.0_f32.to_radians(),
            ranges_mm: (0..360).map(|beam| (1000.0 * range_m(beam)) as u16).collect(),
        }
    }

    fn known_at(x: f64, is_split: bool) -> f64 {
        let id = NodeId { author: AuthorId(1), number: 0 };
        let node = pose(2.0, 0.0, 0.0);
        let signature = Signature { descriptor: None, scan: seen_from(2.0, is_split) };
        let ops =
            vec![Op::PutNode { id, kind: NodeKind::Main, pose: to_fixed(&node) }, Op::SetSignature { id, signature }];
        let mut state = MapState::new();
        state.apply(&Increment { author: id.author, number: 1, hlc_us: 1, ops });
        // Seen with another heading.
        let mut scan = seen_from(x, is_split);
        scan.angle_min = -1.0;
        known_share(&state, &pose(x, 0.0, 1.0), &scan)
    }

    #[test]
    fn a_node_knows_its_side_of_a_wall_only() {
        assert!(known_at(2.0, false) > 0.99);
        assert!(known_at(3.5, false) > 0.8, "{}", known_at(3.5, false));
        assert!(known_at(1.0, true) > 0.9, "{}", known_at(1.0, true));
        assert!(known_at(3.5, true) < 0.5, "{}", known_at(3.5, true));
    }

    #[test]
    fn the_most_telling_scan_comes_first_and_what_adds_little_is_left_out() {
        let (near, middle, far) = (seen_from(0.5, true), seen_from(1.5, true), seen_from(4.5, true));
        let seen = [(pose(0.5, 0.0, 0.0), &near), (pose(1.5, 0.0, 0.0), &middle), (pose(4.5, 0.0, 0.0), &far)];
        let told = most_telling(ScanCoverage::default(), &seen, 1.0);
        assert_eq!(told.len(), 2, "one for each side of the wall: {told:?}");
        assert!(told.contains(&2));
        assert!(most_telling(ScanCoverage::default(), &seen, 100.0).is_empty());
    }

    #[test]
    fn an_empty_map_knows_nothing_and_nothing_is_always_known() {
        let mut scan = seen_from(2.0, false);
        assert!(known_share(&MapState::new(), &Pose2::identity(), &scan) == 0.0);
        scan.ranges_mm.fill(0);
        assert!(known_share(&MapState::new(), &Pose2::identity(), &scan) == 1.0);
    }
}
