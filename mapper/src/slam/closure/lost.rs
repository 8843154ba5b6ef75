//! A robot that is lost, found again in some submap.

use super::places::{places, standing_out};
use super::{Found, LoopCloser, LostSearch};
use crate::slam::estimate::Lost;
use crate::slam::graph::KeyframeGraph;
use std::f64::consts::PI;

impl LoopCloser {
    /// Looks for a lost robot in every submap, at every heading.
    #[must_use]
    pub fn find(&self, lost: &Lost, graph: &KeyframeGraph) -> LostSearch {
        let config = &self.config;
        let mut good = Vec::new();
        let mut is_anywhere = false;
        for submap in &self.submaps {
            for place in places(submap, &graph.poses()[submap.first()], &lost.points, (0.0, PI), config) {
                // As good as a closure.
                is_anywhere |=
                    place.fit.agreement() >= config.min_agreement && place.fit.overlap() >= config.min_overlap;
                if place.is_good(config) {
                    good.push((place, submap));
                }
            }
        }
        if good.is_empty() && !is_anywhere {
            return LostSearch::Nowhere;
        }
        standing_out(good, config).map_or(LostSearch::Unclear, |(place, submap)| {
            LostSearch::Found(Found {
                submap: submap.clone(),
                submap_from_base: place.found.reference_from_moving,
                odom_from_base: lost.odom_from_base,
            })
        })
    }
}
