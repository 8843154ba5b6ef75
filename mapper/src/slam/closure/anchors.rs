//! What holds a run to a map that it has joined: its keyframes matched to what the map's nodes saw.
//!
//! A node stays where its maker has it; if the maker moves it, the keyframes anchored to it follow.

use super::LoopCloser;
use super::matching::Candidate;
use crate::slam::foreign_nodes::ToldNode;
use crate::slam::graph::{Anchor, KeyframeGraph};
use crate::slam::submap::{Submap, SubmapConfig};
use fht_perception::pose::Pose2;
use fht_proto::NodeId;

impl LoopCloser {
    /// Takes in where a node is that may be anchored to, or that it is no more. Keyframes near a
    /// new one are matched to it.
    pub fn take_anchor(
        &mut self,
        id: NodeId,
        node: Option<&ToldNode>,
        config: &SubmapConfig,
        graph: &mut KeyframeGraph,
    ) {
        let scan = node.and_then(|node| node.scan.as_ref());
        let (Some(node), Some(scan)) = (node, scan) else {
            self.anchorages.remove(&id);
            return graph.put_node(id, None);
        };
        graph.put_node(id, Some(node.map_from_node));
        if self.anchorages.contains_key(&id) {
            return self.feel_anchors(graph);
        }
        self.anchorages.insert(id, Submap::begin(0, config, scan, &scan.points_in_base()));
        let keyframes =
            (1..graph.poses().len()).map(|index| (apart_m(&graph.poses()[index], &node.map_from_node), index));
        let near = self.nearest(keyframes);
        if !near.is_empty() {
            let ways = graph.ways_from(0);
            for index in near {
                self.anchor_to(id, index, self.uncertainty(ways[index]), graph);
            }
        }
    }

    /// Matches a new keyframe to the nearest nodes that it may be anchored to.
    pub(super) fn anchor(&mut self, index: usize, graph: &mut KeyframeGraph) {
        if !self.anchorages.is_empty() {
            let window = self.uncertainty(graph.ways_from(0)[index]);
            self.anchor_within(index, window, graph);
        }
    }

    /// The same, within a window: half widths, metres and radians.
    pub(super) fn anchor_within(&mut self, index: usize, window: (f64, f64), graph: &mut KeyframeGraph) {
        if index == 0 {
            return; // the map's frame
        }
        let here = graph.poses()[index];
        let near = self.nearest(graph.nodes().iter().map(|(id, pose)| (apart_m(&here, pose), *id)));
        for id in near {
            self.anchor_to(id, index, window, graph);
        }
    }

    /// Those within reach, nearest first, as many as are tried.
    fn nearest<T: Ord>(&self, all: impl Iterator<Item = (f64, T)>) -> Vec<T> {
        let mut near: Vec<(f64, T)> = all.filter(|(apart_m, _)| *apart_m < self.config.reach_m).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.into_iter().take(self.config.anchors).map(|(_, it)| it).collect()
    }

    fn anchor_to(&mut self, id: NodeId, index: usize, (window_m, window_rad): (f64, f64), graph: &mut KeyframeGraph) {
        let (Some(submap), Some(map_from_node)) = (self.anchorages.get(&id), graph.nodes().get(&id)) else { return };
        let guess = map_from_node.inverse() * graph.poses()[index];
        let distance_m = guess.translation.vector.norm();
        let candidate = Candidate { submap: 0, guess, window_m, window_rad, distance_m };
        let Some(edge) = self.match_within(submap, index, &candidate) else {
            self.counts.refused += 1;
            return;
        };
        self.counts.anchored += 1;
        let (node_from_keyframe, information) = (edge.measured, edge.information);
        graph.anchor(Anchor { node: id, keyframe: index, node_from_keyframe, information });
        self.feel_anchors(graph);
    }

    /// Anchors pull at the graph as closures do.
    fn feel_anchors(&mut self, graph: &KeyframeGraph) {
        self.tension = self.tension.max(graph.anchor_tension(self.config.most_tension) - self.relaxed);
    }
}

fn apart_m(a: &Pose2, b: &Pose2) -> f64 {
    (a.translation.vector - b.translation.vector).norm()
}
