//! A robot that is lost, found again in some submap.

use super::matching::judge;
use super::{Found, LoopCloser, LostSearch};
use crate::slam::estimate::Lost;
use crate::slam::graph::KeyframeGraph;
use fht_perception::matching::{SearchWindow, alignments};
use fht_perception::pose::{Pose2, pose};
use std::f64::consts::PI;

impl LoopCloser {
    /// Looks for a lost robot in every submap, at every heading.
    #[must_use]
    pub fn find(&self, lost: &Lost, graph: &KeyframeGraph) -> LostSearch {
        let (config, points) = (&self.config, lost.points.as_slice());
        let mut fits: Vec<(i64, Pose2, Found)> = Vec::new();
        let mut is_anywhere = false;
        for submap in &self.submaps {
            let middle = submap.members()[submap.members().len() / 2].translation;
            let window = SearchWindow {
                centre: pose(middle.x, middle.y, 0.0),
                half_x_m: config.lost_window_m,
                half_y_m: config.lost_window_m,
                half_yaw_rad: PI,
            };
            for found in alignments(submap.cloud(), points, &window, &config.matching) {
                let (found, verdict) = judge(submap, points, found);
                let is_good = verdict.agreement() >= config.lost_agreement && verdict.overlap() >= config.lost_overlap;
                // As good as a closure.
                is_anywhere |= verdict.agreement() >= config.min_agreement && verdict.overlap() >= config.min_overlap;
                if is_good {
                    let submap_from_base = found.reference_from_moving;
                    let map_from_base = graph.poses()[submap.first()] * submap_from_base;
                    let odom_from_base = lost.odom_from_base;
                    let found = Found { submap: submap.clone(), submap_from_base, odom_from_base };
                    fits.push((verdict.balance(), map_from_base, found));
                }
            }
        }
        let best = fits.iter().max_by_key(|(balance, ..)| *balance);
        let Some((balance, place, found)) = best else {
            return if is_anywhere { LostSearch::Unclear } else { LostSearch::Nowhere };
        };
        let is_elsewhere = |other: &Pose2| {
            let apart = place.inverse() * other;
            apart.translation.vector.norm() > 1.0 || apart.rotation.angle().abs() > 0.3
        };
        let rival = fits.iter().filter(|(_, other, _)| is_elsewhere(other)).map(|(balance, ..)| *balance).max();
        let is_clear = rival.is_none_or(|rival| (rival as f64) < config.lost_ambiguity * *balance as f64);
        if is_clear { LostSearch::Found(found.clone()) } else { LostSearch::Unclear }
    }
}
