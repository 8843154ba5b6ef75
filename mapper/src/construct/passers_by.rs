//! People whom a main node's scan shows: what it saw is not there any more. (Not in the paper, in
//! whose buildings nobody walks.)
//!
//! A return that ends where the robot's grid has free floor by now, with nothing occupied near, was
//! somebody's. Who was seen walking is not in the scan in the first place
//! ([`Bystanders`](fht_navigation::people::Bystanders)); this is for who stood, and left. Where
//! people walk, things of a person's width that stand alone are left out as well: at once, when
//! somebody has walked by; and at the end of what was seen before, unless another node has seen
//! them at another time.

use super::config::PasserByConfig;
use fht_map::NodeRef;
use fht_perception::frame::LaserScan;
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::{Point2, from_fixed};
use fht_perception::segments::ScanSegment;
use fht_perception::square::{SquareIndex, square_of};
use fht_perception::standing_alone::{StandingAlone, standing_alone};
use fht_proto::{NodeId, Op, Signature};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// The operation that takes people who have left out of a node's scan; none if it shows nobody. At
/// the end of a run nodes stand where they belong: then a crowd is taken out, too, if the rest of
/// the scan still fits.
pub(super) fn without_them(
    node: &NodeRef<'_>,
    grid: &OccupancyGrid,
    is_end: bool,
    config: &PasserByConfig,
) -> Option<Op> {
    let signature = node.signature?;
    let scan = LaserScan::from_record(&signature.scan);
    let map_from_base = from_fixed(node.pose);
    let end = |beam: usize| map_from_base * scan.beam_end_in_base(beam);
    let is_return = |beam: usize| scan.is_return(scan.ranges_m[beam]);
    let beams = 0..scan.ranges_m.len();
    let is_open: Vec<bool> =
        beams.clone().map(|beam| is_return(beam) && is_open(grid, end(beam), config.slack_m)).collect();
    let runs = is_open.chunk_by(|a, b| a == b).scan(0, |from, run| {
        *from += run.len();
        Some(*from - run.len()..*from)
    });
    let runs = runs.filter(|run| is_open[run.start] && run.len() >= config.least_returns);
    let gone: BTreeSet<usize> = runs.flatten().collect();
    let fits = || {
        let left: Vec<usize> = beams.filter(|beam| is_return(*beam) && !gone.contains(beam)).collect();
        let fitting = left.iter().filter(|beam| is_beside_something(grid, end(**beam), config.slack_m)).count();
        !left.is_empty() && fitting as f64 >= config.fitting_share * left.len() as f64
    };
    let most_share = if is_end && fits() { config.most_share_if_fitting } else { config.most_share };
    blanked(node, gone.into_iter(), most_share)
}

/// The operation that takes the returns of some beams out of a node's scan; none if there are none,
/// or if they are more than a share of all.
fn blanked(node: &NodeRef<'_>, beams: impl Iterator<Item = usize>, most_share: f64) -> Option<Op> {
    let signature = node.signature?;
    let mut record = signature.scan.clone();
    let returns = |ranges_mm: &[u16]| ranges_mm.iter().filter(|mm| **mm > 0).count();
    beams.for_each(|beam| record.ranges_mm[beam] = 0);
    let (all, left) = (returns(&signature.scan.ranges_mm), returns(&record.ranges_mm));
    let is_some = left < all && (all - left) as f64 <= most_share * all as f64;
    let signature = || Signature { descriptor: signature.descriptor.clone(), scan: record };
    is_some.then(|| Op::SetSignature { id: node.id, signature: signature() })
}

/// Where returns of main nodes end, in squares, and at which frames of the run.
#[derive(Default)]
pub(super) struct Sightings(HashMap<SquareIndex, Vec<u64>>);

/// Side of these squares, metres.
const SQUARE_M: f64 = 0.2;

fn square(place: Point2) -> SquareIndex {
    square_of(place, SQUARE_M)
}

impl Sightings {
    /// What main nodes have seen; `frames` says when.
    pub(super) fn of<'a>(nodes: impl Iterator<Item = NodeRef<'a>>, frames: &BTreeMap<NodeId, u64>) -> Self {
        let mut seen = Self::default();
        for node in nodes {
            let (Some(signature), Some(&frame)) = (node.signature, frames.get(&node.id)) else { continue };
            let map_from_base = from_fixed(node.pose);
            for end in LaserScan::record_points_in_base(&signature.scan) {
                seen.0.entry(square(map_from_base * end)).or_default().push(frame);
            }
        }
        seen
    }

    /// Whether something was seen at a place so many frames before or after one.
    fn confirm(&self, place: Point2, frame: u64, apart: u64) -> bool {
        let (i, j) = square(place);
        let around = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| (i, j)));
        around.filter_map(|square| self.0.get(&square)).flatten().any(|other| other.abs_diff(frame) >= apart)
    }

    /// The operation that takes out of a node's scan, taken at a frame, what may be somebody: of a
    /// person's width, alone, and not seen at another time.
    pub(super) fn without_doubtful(&self, node: &NodeRef<'_>, frame: u64, config: &PasserByConfig) -> Option<Op> {
        let scan = LaserScan::from_record(&node.signature?.scan);
        let map_from_base = from_fixed(node.pose);
        let is_confirmed = |thing: &ScanSegment| {
            let mut places = thing.beams().map(|beam| map_from_base * scan.beam_end_in_base(beam));
            places.any(|place| self.confirm(place, frame, config.apart_frames))
        };
        let PasserByConfig { widest_m, alone_m: gap_m, least_returns, .. } = *config;
        let things = standing_alone(&scan, &[], &StandingAlone { widest_m, gap_m, least_returns });
        let doubtful = things.into_iter().filter(|thing| !is_confirmed(thing));
        blanked(node, doubtful.flat_map(ScanSegment::beams), config.most_share)
    }
}

/// Whether this robot's own scans say that a place is free, and nothing stands near it.
fn is_open(grid: &OccupancyGrid, place: Point2, slack_m: f64) -> bool {
    let centre = grid.cell_of(place);
    grid.state(centre) == CellState::Free && grid.is_own(centre) && !is_beside_something(grid, place, slack_m)
}

/// Whether something stands within `slack_m` of a place.
fn is_beside_something(grid: &OccupancyGrid, place: Point2, slack_m: f64) -> bool {
    let centre = grid.cell_of(place);
    let reach = (slack_m / grid.resolution_m()).ceil() as i32;
    let around = (-reach..=reach).flat_map(|dj| (-reach..=reach).map(move |di| (di, dj)));
    let mut near = around
        .map(|(di, dj)| Cell { i: centre.i + di, j: centre.j + dj })
        .filter(|&cell| (grid.centre(cell) - place).norm() <= slack_m);
    near.any(|cell| grid.state(cell) == CellState::Occupied)
}
