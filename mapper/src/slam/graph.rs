//! Keyframes and what was measured between them.

use fht_robot::pose::Pose2;
use fht_robot::pose_graph::{Edge, GraphConfig, GraphError, optimise};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The pose graph of a run. Keyframe 0 stays where it is: the map frame.
#[derive(Clone, Debug, Default)]
pub struct KeyframeGraph {
    poses: Vec<Pose2>,
    edges: Vec<Edge>,
    /// Neighbours, and how much uncertainty has been driven in between, in metres of ordinary driving.
    ways: Vec<Vec<(usize, f64)>>,
}

/// An edge, and for how many metres of ordinary driving its uncertainty counts.
#[derive(Clone, Debug)]
pub struct Link {
    /// The measurement.
    pub edge: Edge,
    /// Metres.
    pub way_m: f64,
}

impl Link {
    /// A measurement whose uncertainty is that of ordinary driving.
    #[must_use]
    pub fn ordinary(edge: Edge) -> Self {
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
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Adds a keyframe where the first of its links says; links lead from earlier keyframes to this one.
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

    /// Takes away all edges that may be wrong.
    pub fn drop_doubtful(&mut self) {
        self.edges.retain(|edge| !edge.is_doubtful);
    }

    /// Moves the poses to where the edges are satisfied best.
    ///
    /// # Errors
    /// [`GraphError`]; the poses are then unchanged.
    pub fn optimise(&mut self, config: &GraphConfig) -> Result<(), GraphError> {
        optimise(&mut self.poses, &self.edges, config)
    }

    /// Shortest ways from a keyframe to all others, metres: error grows with them, and a closure makes them short.
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
