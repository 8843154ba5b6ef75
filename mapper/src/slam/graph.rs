//! Keyframes and what was measured between them; and, in a run that has joined a map, between them
//! and nodes of the map.

use fht_perception::pose::Pose2;
use fht_perception::pose_graph::{GraphConfig, GraphError, PoseConstraint, chi2, optimise};
use fht_proto::NodeId;
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// The pose graph of a run. Keyframe 0 stays where it is: the map frame.
#[derive(Clone, Debug, Default)]
pub struct KeyframeGraph {
    poses: Vec<Pose2>,
    edges: Vec<PoseConstraint>,
    anchors: Vec<Anchor>,
    /// Where the nodes are that keyframes are anchored to, as their makers have them.
    nodes: BTreeMap<NodeId, Pose2>,
    /// Neighbours, and how much uncertainty has been driven in between, in metres of ordinary
    /// driving.
    ways: Vec<Vec<(usize, f64)>>,
}

/// An edge, and for how many metres of ordinary driving its uncertainty counts.
#[derive(Clone, Debug)]
pub struct Link {
    /// The measurement.
    pub edge: PoseConstraint,
    /// Metres.
    pub way_m: f64,
}

/// Where a keyframe is, seen from a node of the map that another robot made.
#[derive(Clone, Debug)]
pub struct Anchor {
    /// The node.
    pub node: NodeId,
    /// The keyframe.
    pub keyframe: usize,
    /// The keyframe in the node's frame.
    pub node_from_keyframe: Pose2,
    /// Inverse covariance of x, y (metres, the node's frame) and yaw (radians).
    pub information: Matrix3<f64>,
}

/// After joining a map, for how many metres of driving the uncertainty of that counts.
const JOINED_WAY_M: f64 = 5.0;

impl Link {
    /// A measurement whose uncertainty is that of ordinary driving.
    #[must_use]
    pub fn ordinary(edge: PoseConstraint) -> Self {
        let way_m = edge.measured.translation.vector.norm();
        Self { edge, way_m }
    }
}

impl KeyframeGraph {
    /// Poses of the keyframes in the map frame.
    #[must_use]
    pub fn poses(&self) -> &[Pose2] {
        &self.poses
    }

    /// The edges, oldest first.
    #[must_use]
    pub fn edges(&self) -> &[PoseConstraint] {
        &self.edges
    }

    /// Adds a keyframe where the first of its links says; links lead from earlier keyframes to this
    /// one.
    pub fn add(&mut self, links: Vec<Link>) -> usize {
        let index = self.poses.len();
        let pose = links.first().map_or_else(Pose2::identity, |link| self.poses[link.edge.from] * link.edge.measured);
        self.poses.push(pose);
        self.ways.push(Vec::new());
        links.into_iter().for_each(|link| self.join(link));
        index
    }

    /// Adds a measurement between keyframes.
    pub fn join(&mut self, link: Link) {
        let Link { edge, way_m } = link;
        self.ways[edge.from].push((edge.to, way_m));
        self.ways[edge.to].push((edge.from, way_m));
        self.edges.push(edge);
    }

    /// Takes away all edges that may be wrong, and all anchors.
    pub fn drop_doubtful(&mut self) {
        self.edges.retain(|edge| !edge.is_doubtful);
        self.anchors.clear();
    }

    /// The robot has found out where the frame of its run lies in the map: everything moves there.
    /// Keyframe 0 is the map's frame, and nothing but its first link tied the run to it.
    pub fn place(&mut self, map_from_run: &Pose2) {
        self.poses.iter_mut().skip(1).for_each(|pose| *pose = map_from_run * *pose);
        let poses = &self.poses;
        for edge in self.edges.iter_mut().filter(|edge| edge.from == 0) {
            edge.measured = poses[edge.to];
        }
        if let Some(first) = self.ways.first_mut() {
            first.iter_mut().for_each(|(_, way_m)| *way_m = way_m.min(JOINED_WAY_M));
        }
        for (_, way_m) in self.ways.iter_mut().skip(1).flatten().filter(|(other, _)| *other == 0) {
            *way_m = way_m.min(JOINED_WAY_M);
        }
    }

    /// A node to be anchored to is here now, or no longer there.
    pub fn put_node(&mut self, node: NodeId, map_from_node: Option<Pose2>) {
        match map_from_node {
            Some(pose) => _ = self.nodes.insert(node, pose),
            None => {
                self.nodes.remove(&node);
                self.anchors.retain(|anchor| anchor.node != node);
            }
        }
    }

    /// The nodes that may be anchored to.
    #[must_use]
    pub fn nodes(&self) -> &BTreeMap<NodeId, Pose2> {
        &self.nodes
    }

    /// Anchors a keyframe to a node that is there.
    pub fn anchor(&mut self, anchor: Anchor) {
        // What is known against the map is known against all that is known against it.
        self.ways[0].push((anchor.keyframe, 0.0));
        self.ways[anchor.keyframe].push((0, 0.0));
        self.anchors.push(anchor);
    }

    /// How far anchors pull at the graph (sum of squared Mahalanobis distances, each at most
    /// `most`).
    #[must_use]
    pub fn anchor_tension(&self, most: f64) -> f64 {
        self.anchor_edges().map(|edge| chi2(&edge, &self.poses).min(most)).sum()
    }

    /// The anchors as measurements from the map's frame.
    fn anchor_edges(&self) -> impl Iterator<Item = PoseConstraint> + '_ {
        self.anchors.iter().filter_map(|anchor| {
            let map_from_node = self.nodes.get(&anchor.node)?;
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), map_from_node.rotation.angle()).into_inner();
            Some(PoseConstraint {
                from: 0,
                to: anchor.keyframe,
                measured: map_from_node * anchor.node_from_keyframe,
                information: turn * anchor.information * turn.transpose(),
                is_doubtful: true,
            })
        })
    }

    /// Moves the poses to where the edges are satisfied best.
    ///
    /// # Errors
    /// [`GraphError`]; the poses are then unchanged.
    pub fn optimise(&mut self, config: &GraphConfig) -> Result<(), GraphError> {
        if self.anchors.is_empty() {
            return optimise(&mut self.poses, &self.edges, config);
        }
        let edges: Vec<PoseConstraint> = self.edges.iter().cloned().chain(self.anchor_edges()).collect();
        optimise(&mut self.poses, &edges, config)
    }

    /// Shortest ways from a keyframe to all others, metres: error grows with them, and a closure
    /// makes them short.
    #[must_use]
    pub fn ways_from(&self, index: usize) -> Vec<f64> {
        // Millimetres as integers: an order without NaN.
        let mut shortest = vec![u64::MAX; self.poses.len()];
        let mut queue = BinaryHeap::from([(Reverse(0_u64), index)]);
        shortest[index] = 0;
        while let Some((Reverse(way), here)) = queue.pop() {
            if way > shortest[here] {
                continue;
            }
            for &(next, metres) in &self.ways[here] {
                let longer = way.saturating_add((metres * 1000.0) as u64);
                if longer < shortest[next] {
                    shortest[next] = longer;
                    queue.push((Reverse(longer), next));
                }
            }
        }
        let metres = |way: u64| if way == u64::MAX { f64::INFINITY } else { way as f64 * 1e-3 };
        shortest.into_iter().map(metres).collect()
    }
}

/// The link between the map's frame and the first keyframe of a run that is to join the map: it
/// says next to nothing.
pub(super) fn unplaced_link(first: usize) -> Link {
    let (measured, information) = (Pose2::identity(), Matrix3::identity());
    // Longer than any window grows.
    Link { edge: PoseConstraint { from: 0, to: first, measured, information, is_doubtful: false }, way_m: 1e3 }
}
