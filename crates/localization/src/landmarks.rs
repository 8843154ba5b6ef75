//! The replica's main nodes: what they look like, and what they saw.
//!
//! What they saw together is put together when it is first asked for after the map has changed.

use fht_map::MapState;
use fht_perception::evidence_grid::Sighting;
use fht_perception::frame::LaserScan;
use fht_perception::matching::BranchAndBoundConfig;
use fht_perception::pose::{Point2, Pose2, from_fixed};
use fht_perception::reference_map::ReferenceMap;
use fht_proto::{Descriptor, DescriptorModel, FixedPoint, ModelId, NodeId, Rect, Signature};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, OnceLock};

/// Why a robot cannot compare what it sees with the map's descriptors; its scans still are of use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnusableDescriptors {
    /// No node looks like anything.
    #[error(
        "none of the map's {main_nodes} main nodes carries a descriptor (it was made without cameras); this robot compares \
         descriptors of the model '{own}'"
    )]
    NoDescriptors {
        /// Main nodes of the map.
        main_nodes: usize,
        /// The robot's model.
        own: String,
    },
    /// All descriptors are of other models.
    #[error(
        "the map's descriptors are of the model {map}, this robot's of '{own}': neither can be compared with the other"
    )]
    OtherModel {
        /// The models that the map's nodes use.
        map: String,
        /// The robot's model.
        own: String,
    },
}

/// Checks that some node of `map` carries a descriptor of the robot's model `own`.
///
/// # Errors
/// [`UnusableDescriptors`], with the names of both models.
pub fn check_usable(map: &MapState, own: &DescriptorModel) -> Result<(), UnusableDescriptors> {
    let descriptors = map.nodes().filter_map(|node| node.signature?.descriptor.as_ref());
    let models: BTreeSet<ModelId> = descriptors.map(|descriptor| descriptor.model).collect();
    if models.contains(&own.id) {
        return Ok(());
    }
    if models.is_empty() {
        return Err(UnusableDescriptors::NoDescriptors { main_nodes: map.counts().main_nodes, own: own.name.clone() });
    }
    let name = |id: &ModelId| {
        let model = map.models().find(|model| model.id == *id);
        model.map_or_else(|| format!("{id:?} (not described in the map)"), |model| format!("'{}'", model.name))
    };
    let names: Vec<String> = models.iter().map(name).collect();
    Err(UnusableDescriptors::OtherModel { map: names.join(", "), own: own.name.clone() })
}

/// A main node with its scan.
#[derive(Clone)]
pub struct Landmark {
    /// Which node.
    pub id: NodeId,
    /// Where it is: map frame from the frame of the base that took its scan.
    pub map_from_node: Pose2,
    /// Its scanner, in the node's frame.
    pub scanner: Point2,
    /// End points of its scan, in the node's frame.
    pub points: Vec<Point2>,
    signature: Signature,
}

/// All main nodes of a map and the free space of all nodes.
#[derive(Default)]
pub struct Landmarks {
    by_id: BTreeMap<NodeId, Arc<Landmark>>,
    free_space: Vec<(FixedPoint, Rect)>,
    thresholds: BTreeMap<ModelId, f32>,
    walls: OnceLock<ReferenceMap>,
}

/// What walls are made of.
pub struct WallsTask {
    landmarks: Vec<Arc<Landmark>>,
    free_space: Vec<(FixedPoint, Rect)>,
}

impl WallsTask {
    /// Makes them: some 20 ms for 100 nodes.
    #[must_use]
    pub fn run(self) -> ReferenceMap {
        let sightings: Vec<Sighting> = self.landmarks.iter().map(|landmark| landmark.sighting()).collect();
        ReferenceMap::new(&sightings, &self.free_space, &BranchAndBoundConfig::default())
    }
}

impl Landmarks {
    /// Follows the map: new, changed, moved and removed nodes. What they saw is put together when
    /// it is next asked for.
    pub fn refresh(&mut self, map: &MapState) {
        self.walls = OnceLock::new();
        self.follow(map);
    }

    /// The same, but for what they saw: that stays as it was until [`Landmarks::take_walls`], so
    /// that a thread beside the robot's loop can put it together.
    pub fn follow(&mut self, map: &MapState) {
        self.by_id.retain(|id, _| map.node(*id).is_some_and(|node| node.signature.is_some()));
        self.free_space.clear();
        for node in map.nodes() {
            if let Some(rect) = node.free_space {
                self.free_space.push((node.pose.position, rect));
            }
            let Some(signature) = node.signature else { continue };
            let map_from_node = from_fixed(node.pose);
            match self.by_id.get_mut(&node.id) {
                Some(known) if known.signature == *signature => {
                    if known.map_from_node != map_from_node {
                        Arc::make_mut(known).map_from_node = map_from_node;
                    }
                }
                _ => {
                    self.by_id.insert(node.id, Arc::new(Landmark::new(node.id, map_from_node, signature)));
                }
            }
        }
        self.thresholds = map.models().map(|model| (model.id, f32::from(model.match_threshold_e3) / 1000.0)).collect();
    }

    /// What all of them saw.
    #[must_use]
    pub fn walls(&self) -> &ReferenceMap {
        self.walls.get_or_init(|| self.walls_task().run())
    }

    /// Whether that was put together, be it of an older state.
    #[must_use]
    pub fn has_walls(&self) -> bool {
        self.walls.get().is_some()
    }

    /// What is to be put together now.
    #[must_use]
    pub fn walls_task(&self) -> WallsTask {
        WallsTask { landmarks: self.by_id.values().cloned().collect(), free_space: self.free_space.clone() }
    }

    /// Takes what was put together.
    pub fn take_walls(&mut self, walls: ReferenceMap) {
        self.walls = OnceLock::from(walls);
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

    /// How much each main node looks like `descriptor`: cosines, in the order of their ids. Nodes
    /// without a descriptor of the same model are left out.
    #[must_use]
    pub fn similarities(&self, descriptor: &Descriptor) -> Vec<(NodeId, f32)> {
        let similarity = |landmark: &Arc<Landmark>| landmark.signature.descriptor.as_ref()?.similarity(descriptor);
        self.by_id.values().filter_map(|landmark| Some((landmark.id, similarity(landmark)?))).collect()
    }

    /// One of them.
    #[must_use]
    pub fn get(&self, id: NodeId) -> Option<&Landmark> {
        self.by_id.get(&id).map(Arc::as_ref)
    }
}

impl Landmark {
    /// What it looks like, if there were cameras and light.
    #[must_use]
    pub fn descriptor(&self) -> Option<&Descriptor> {
        self.signature.descriptor.as_ref()
    }

    fn new(id: NodeId, map_from_node: Pose2, signature: &Signature) -> Self {
        let points = LaserScan::record_points_in_base(&signature.scan);
        Self {
            id,
            map_from_node,
            scanner: Point2::from(from_fixed(signature.scan.base_from_sensor).translation.vector),
            points,
            signature: signature.clone(),
        }
    }

    fn sighting(&self) -> Sighting {
        let ends = self.points.iter().map(|point| self.map_from_node * point).collect();
        Sighting { from: self.map_from_node * self.scanner, ends }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{AuthorId, FixedPose, Increment, NodeKind, Op, ScanRecord};

    fn model(id: u32, name: &str) -> DescriptorModel {
        DescriptorModel { id: ModelId(id), name: name.to_owned(), dimension: 2, match_threshold_e3: 500 }
    }

    /// A map of one main node, with a descriptor of `of` if any.
    fn map_with(of: Option<&DescriptorModel>) -> MapState {
        let author = AuthorId(1);
        let id = NodeId { author, number: 0 };
        let scan = ScanRecord {
            base_from_sensor: FixedPose::default(),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![1000; 60],
        };
        let descriptor = of.map(|model| Descriptor::quantise(model.id, &[0.6, 0.8]));
        let mut ops = vec![
            Op::PutNode { id, kind: NodeKind::Main, pose: FixedPose::default() },
            Op::SetSignature { id, signature: Signature { descriptor, scan } },
        ];
        ops.extend(of.map(|model| Op::PutModel { model: model.clone() }));
        let mut map = MapState::new();
        map.apply(&Increment { author, number: 1, hlc_us: 1, ops });
        map
    }

    #[test]
    fn descriptors_are_of_use_only_if_they_are_of_the_robots_model() {
        let (own, other) = (model(1, "ours"), model(2, "theirs"));
        assert_eq!(check_usable(&map_with(Some(&own)), &own), Ok(()));
        let error = check_usable(&map_with(Some(&other)), &own).map_err(|error| error.to_string());
        assert!(error.is_err_and(|sentence| sentence.contains("'theirs'") && sentence.contains("'ours'")));
        let error = check_usable(&map_with(None), &own);
        assert_eq!(error, Err(UnusableDescriptors::NoDescriptors { main_nodes: 1, own: "ours".to_owned() }));
    }
}
