//! Closures after a very long way: the robot may be so far off that it is looked for like one that
//! is lost, in all submaps within its uncertainty.
//!
//! Many places look alike then. One is a witness only if no other is nearly as good, and is
//! believed, as after any long way, when several keyframes say the same.

use super::matching::{BestMatch, with_floor};
use super::places::{places, standing_out};
use super::{LoopCloser, distance_m};
use crate::slam::graph::KeyframeGraph;
use fht_perception::pose_graph::PoseConstraint;
use std::f64::consts::PI;

impl LoopCloser {
    /// Looks for a keyframe in the submaps that are too far off for a search around where the graph
    /// says.
    pub(super) fn close_wide(&mut self, index: usize, graph: &mut KeyframeGraph) {
        let config = &self.config;
        // Where one keyframe stood out, its neighbours are asked, too.
        let is_hot = self.stood_out.is_some_and(|last| index <= last + config.wide_every);
        if !index.is_multiple_of(if is_hot { config.search_every } else { config.wide_every }) {
            return;
        }
        let ways = graph.ways_from(index);
        let poses = graph.poses();
        let mut good = Vec::new();
        let mut is_tried = false;
        for submap in &self.submaps {
            let way_m = submap.keyframes().map(|member| ways[member]).fold(f64::INFINITY, f64::min);
            let is_wide = self.window_m(way_m) > config.max_window_m;
            if !is_wide || distance_m(submap, index, graph) > config.reach_m + config.wide_window_per_m * way_m {
                continue;
            }
            is_tried = true;
            let map_from_submap = &poses[submap.first()];
            let yaw_rad = (map_from_submap.inverse() * poses[index]).rotation.angle();
            let half_yaw_rad = (config.window_rad + config.wide_rad_per_sqrt_m * way_m.sqrt()).min(PI);
            let found = places(submap, map_from_submap, &self.points[index], (yaw_rad, half_yaw_rad), config);
            good.extend(found.filter(|place| place.is_good(config)).map(|place| (place, submap.first())));
        }
        let edge = standing_out(good, config).and_then(|(place, from)| {
            let information = with_floor(&place.found.covariance, config.floor_m, config.floor_rad)?;
            let measured = place.found.reference_from_moving;
            Some(PoseConstraint { from, to: index, measured, information, is_doubtful: true })
        });
        match edge {
            Some(edge) => {
                self.stood_out = Some(index);
                self.take_far(BestMatch { edge, is_sure: true }, graph);
            }
            None => self.counts.refused += usize::from(is_tried),
        }
    }
}
