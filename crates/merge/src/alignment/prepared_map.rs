//! A map as it is compared with another: its main nodes with what they saw, and all of that
//! together.

use fht_map::MapState;
use fht_perception::evidence_grid::{Beams, EvidenceConfig, Sighting};
use fht_perception::frame::LaserScan;
use fht_perception::matching::BranchAndBoundConfig;
use fht_perception::pose::{Point2, Pose2, from_fixed};
use fht_perception::reference_map::ReferenceMap;
use fht_perception::square::one_per_square;
use fht_proto::{Descriptor, NodeId};

/// A main node.
pub(crate) struct PreparedNode<'a> {
    pub(crate) id: NodeId,
    /// Where it is in its map.
    pub(crate) map_from_node: Pose2,
    /// Its scanner, node frame.
    scanner: Point2,
    /// Ends of its beams, node frame.
    pub(crate) points: Vec<Point2>,
    pub(crate) beams: Beams,
    pub(crate) descriptor: Option<&'a Descriptor>,
}

impl PreparedNode<'_> {
    pub(crate) fn position(&self) -> Point2 {
        Point2::from(self.map_from_node.translation.vector)
    }

    /// What was seen from it, if it is at `frame_from_node`.
    pub(crate) fn sighting(&self, frame_from_node: &Pose2) -> Sighting {
        let ends = self.points.iter().map(|point| frame_from_node * point).collect();
        Sighting { from: frame_from_node * self.scanner, ends }
    }
}

/// A map.
pub(crate) struct PreparedMap<'a> {
    /// Its main nodes, in the order of their ids.
    pub(crate) places: Vec<PreparedNode<'a>>,
    pub(crate) walls: ReferenceMap,
}

/// Side of the squares of which one point each is kept, metres.
const SQUARE_M: f64 = 0.25;

impl<'a> PreparedMap<'a> {
    pub(crate) fn of(map: &'a MapState, search: &BranchAndBoundConfig, evidence: &EvidenceConfig) -> Self {
        let places: Vec<PreparedNode<'a>> = map
            .main_nodes()
            .filter_map(|node| {
                let signature = node.signature?;
                Some(PreparedNode {
                    id: node.id,
                    map_from_node: from_fixed(node.pose),
                    scanner: Point2::from(from_fixed(signature.scan.base_from_sensor).translation.vector),
                    points: LaserScan::record_points_in_base(&signature.scan),
                    beams: Beams::of(&LaserScan::from_record(&signature.scan), evidence),
                    descriptor: signature.descriptor.as_ref(),
                })
            })
            .collect();
        let sightings: Vec<Sighting> = places.iter().map(|place| place.sighting(&place.map_from_node)).collect();
        let free: Vec<_> = map.nodes().filter_map(|node| Some((node.pose.position, node.free_space?))).collect();
        Self { walls: ReferenceMap::new(&sightings, &free, search), places }
    }

    /// The places nearest to one, itself first: at most `count`, within `reach_m` metres.
    pub(crate) fn around(&self, index: usize, count: usize, reach_m: f64) -> Vec<usize> {
        let here = self.places[index].position();
        let distance = |other: &usize| (self.places[*other].position() - here).norm();
        let mut near: Vec<usize> = (0..self.places.len()).filter(|other| distance(other) <= reach_m).collect();
        near.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then((*a != index).cmp(&(*b != index))));
        near.truncate(count);
        near
    }

    /// What was seen from a place and those around it, in its frame, evenly spread.
    pub(crate) fn seen_around(&self, index: usize, around: &[usize]) -> Vec<Point2> {
        let node_from_map = self.places[index].map_from_node.inverse();
        let others = around.iter().map(|&other| &self.places[other]);
        let seen = others.flat_map(|other| {
            let node_from_other = node_from_map * other.map_from_node;
            other.points.iter().map(move |point| node_from_other * point)
        });
        one_per_square(seen, SQUARE_M)
    }
}
