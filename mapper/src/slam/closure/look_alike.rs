//! Closures where the panorama looks like an earlier one.

use super::matching::{BestMatch, Candidate};
use super::{LoopCloser, SubmapSighting};
use crate::slam::graph::KeyframeGraph;
use std::f64::consts::PI;

impl LoopCloser {
    /// Takes a panorama's look in, and searches where an earlier one looked alike.
    pub fn observe_appearance(&mut self, sighting: SubmapSighting, graph: &mut KeyframeGraph) {
        // Panoramas of one place are one witness.
        let is_due = self.tried_alike.is_none_or(|last| sighting.keyframe >= last + self.config.search_every);
        if is_due && self.try_look_alike(&sighting, graph) {
            self.tried_alike = Some(sighting.keyframe);
        }
        self.sightings.push(sighting);
    }

    fn try_look_alike(&mut self, sighting: &SubmapSighting, graph: &mut KeyframeGraph) -> bool {
        let least = self.config.min_similarity.unwrap_or(sighting.match_threshold);
        let ways = graph.ways_from(sighting.keyframe);
        let cosine = |other: &SubmapSighting| -> f32 {
            other.components.iter().zip(sighting.components.iter()).map(|(a, b)| a * b).sum()
        };
        let alike = self
            .sightings
            .iter()
            .filter(|other| ways[other.keyframe] > self.config.look_alike_way_m)
            .map(|other| (cosine(other), other.keyframe))
            .filter(|(cosine, _)| *cosine >= least)
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, there)) = alike else { return false };
        let Some(submap) = self.submaps.iter().position(|submap| submap.has(there)) else { return false };
        // The cameras look all around, so headings may be anything; the place is within sight of
        // the other.
        let member = self.submaps[submap].members()[there - self.submaps[submap].first()];
        let candidate =
            Candidate { submap, guess: member, window_m: self.config.look_alike_m, window_rad: PI, distance_m: 0.0 };
        // Many places look alike; it is another one when it is farther off than the way can have
        // led astray.
        let found = self.match_to(sighting.keyframe, &candidate);
        match found.filter(|edge| self.is_plausible(edge, ways[there], graph)) {
            Some(edge) => {
                self.counts.look_alike += 1;
                self.take_far(BestMatch { edge, is_sure: true }, graph);
            }
            None => self.counts.refused += 1,
        }
        true
    }
}
