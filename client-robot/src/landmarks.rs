//! The replica's main nodes, prepared for matching.
//!
//! Clouds with normals cost some milliseconds each, so they are made once for a node and kept until its scan changes;
//! poses follow the map whenever a correction moves a node.

use crate::visibility::PolarScan;
use fht_map::MapState;
use fht_proto::{Descriptor, FixedPoint, ModelId, NodeId, Rect, Signature};
use fht_robot::frame::LaserScan;
use fht_robot::matching::ReferenceCloud;
use fht_robot::pose::{Point2, Pose2, from_fixed};
use std::collections::BTreeMap;

/// A main node with its scan.
pub struct Landmark {
    /// Which node.
    pub id: NodeId,
    /// Where it is: map frame from the frame of the base that took its scan.
    pub map_from_node: Pose2,
    /// End points of its scan, in the node's frame.
    pub points: Vec<Point2>,
    /// The same with normals.
    pub cloud: ReferenceCloud,
    /// The same by direction.
    pub polar: PolarScan,
    signature: Signature,
}

/// All main nodes of a map and the free space of all nodes.
#[derive(Default)]
pub struct Landmarks {
    by_id: BTreeMap<NodeId, Landmark>,
    free_space: Vec<(FixedPoint, Rect)>,
    thresholds: BTreeMap<ModelId, f32>,
}

impl Landmarks {
    /// Follows the map: new, changed, moved and removed nodes.
    pub fn refresh(&mut self, map: &MapState) {
        self.by_id.retain(|id, _| map.node(*id).is_some_and(|node| node.signature.is_some()));
        self.free_space.clear();
        for node in map.nodes() {
            if let Some(rect) = node.free_space {
                self.free_space.push((node.pose.position, rect));
            }
            let Some(signature) = node.signature else { continue };
            let map_from_node = from_fixed(node.pose);
            match self.by_id.get_mut(&node.id) {
                Some(known) if known.signature == *signature => known.map_from_node = map_from_node,
                _ => {
                    self.by_id.insert(node.id, Landmark::new(node.id, map_from_node, signature));
                }
            }
        }
        self.thresholds = map.models().map(|model| (model.id, f32::from(model.match_threshold_e3) / 1000.0)).collect();
    }

    /// How many.
    #[must_use]
    pub fn len(&self) -> usize {
        self.by_id.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.by_id.is_empty()
    }

    /// The cosine above which descriptors of a model mean "near", if the map describes the model.
    #[must_use]
    pub fn match_threshold(&self, model: ModelId) -> Option<f32> {
        self.thresholds.get(&model).copied()
    }

    /// The main nodes that look most like `descriptor`, best first, with their cosines.
    #[must_use]
    pub fn most_similar(&self, descriptor: &Descriptor, count: usize) -> Vec<(&Landmark, f32)> {
        let similarity = |landmark: &Landmark| landmark.signature.descriptor.as_ref()?.similarity(descriptor);
        let mut all: Vec<(&Landmark, f32)> =
            self.by_id.values().filter_map(|landmark| Some((landmark, similarity(landmark)?))).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.id.cmp(&b.0.id)));
        all.truncate(count);
        all
    }

    /// The main nodes within `radius_m` of a pose, nearest first.
    #[must_use]
    pub fn within(&self, map_from_base: &Pose2, radius_m: f64) -> Vec<&Landmark> {
        let distance = |landmark: &Landmark| {
            landmark.map_from_node.translation.vector.metric_distance(&map_from_base.translation.vector)
        };
        let mut near: Vec<(f64, &Landmark)> = self
            .by_id
            .values()
            .map(|landmark| (distance(landmark), landmark))
            .filter(|&(metres, _)| metres <= radius_m)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
        near.into_iter().map(|(_, landmark)| landmark).collect()
    }

    /// Whether some node's free space contains `point` (map frame) at least `margin_m` inside its border.
    #[must_use]
    pub fn is_free(&self, point: &Point2, margin_m: f64) -> bool {
        self.free_space.iter().any(|(node, rect)| {
            let (min, max) = (rect.min(*node), rect.max(*node));
            point.x > min.0 + margin_m
                && point.x < max.0 - margin_m
                && point.y > min.1 + margin_m
                && point.y < max.1 - margin_m
        })
    }
}

impl Landmark {
    fn new(id: NodeId, map_from_node: Pose2, signature: &Signature) -> Self {
        let points = LaserScan::record_points_in_base(&signature.scan);
        Self {
            id,
            map_from_node,
            cloud: ReferenceCloud::from_points(&points),
            polar: PolarScan::from_record(&signature.scan),
            points,
            signature: signature.clone(),
        }
    }
}
