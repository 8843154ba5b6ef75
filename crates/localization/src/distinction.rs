//! Whether the likeliest place can be told from one that the map does not have.
//!
//! A room that is not on the map may be like one that is. Where the walls alone decide, such a room
//! would have to be the same to the decimetre. Where they leave a tie, as in a rectangle that fits
//! in two ways, something like it may be anywhere, and pictures that merely favour one way over the
//! other prove nothing: they must look like that place and like no other.

use crate::hypotheses::{Hypothesis, SensedView, WeighConfig, held};
use crate::landmarks::Landmarks;
use fht_perception::matching::MatchConfig;
use fht_perception::pose::{Point2, Pose2};
use fht_proto::NodeId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// When a place is told from places that the map does not have.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DistinctionConfig {
    /// Probability against all other places on the map, by the walls alone, from which they decide.
    /// Default 0.97.
    pub min_wall_confidence: f64,
    /// Two places of which one explains up to this share more of a view's beams than the other are
    /// alike in that view. Default 0.03: so much comes from a map that is not exact.
    pub alike_share: f64,
    /// Where they do not, pictures look like the nodes near by this much more than those look like
    /// nodes elsewhere on the map, and than the model's threshold, cosine. Default 0.2: in a
    /// room that was not mapped, as plain as the one that was, it was up to 0.08, at times 0.15.
    pub min_excess: f64,
    /// Whatever the walls say, pictures of a known place are at most this much below the model's
    /// threshold, cosine. Default 0.05.
    pub max_deficit: f64,
    /// Pictures that must have been taken for either. Default 3.
    pub min_pictures: u32,
}

impl Default for DistinctionConfig {
    fn default() -> Self {
        Self { min_wall_confidence: 0.97, alike_share: 0.03, min_excess: 0.2, max_deficit: 0.05, min_pictures: 3 }
    }
}

/// What pictures say of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PictureWord {
    /// There are too few, or they are like those of other places.
    Nothing,
    /// They are of this place and of no other that the map has.
    Tells,
    /// They are not of this place.
    Refuses,
}

/// What a place is judged by.
pub(crate) struct Grounds<'a> {
    /// What was seen, oldest first.
    pub views: &'a [SensedView],
    /// End points of what was seen lately, in the frame of the last view.
    pub points: &'a [Point2],
    /// The map.
    pub landmarks: &'a Landmarks,
    /// How views are held to it.
    pub matching: &'a MatchConfig,
    /// How hypotheses are weighed.
    pub weigh: &'a WeighConfig,
    /// What is one place: metres and radians.
    pub same: (f64, f64),
}

impl Grounds<'_> {
    /// What pictures say of `best`.
    pub fn pictures(&self, best: &Hypothesis, config: &DistinctionConfig) -> PictureWord {
        let mut looks = Looks::default();
        for (at, view) in best.at.iter().zip(self.views) {
            looks.add(at, view, self.landmarks, self.weigh.look_radius_m);
        }
        let (above, excess) = (looks.mean(looks.above), looks.mean(looks.excess));
        tracing::debug!(pictures = looks.pictures, above, excess, "pictures of the likeliest place");
        if looks.pictures < config.min_pictures {
            PictureWord::Nothing
        } else if above < -config.max_deficit {
            PictureWord::Refuses
        } else if excess >= config.min_excess {
            PictureWord::Tells
        } else {
            PictureWord::Nothing
        }
    }

    /// Whether walls alone tell `best` from all `rivals`, and from places that are none of them.
    pub fn walls_tell<'a>(
        &self,
        best: &Hypothesis,
        rivals: impl Iterator<Item = &'a Hypothesis>,
        config: &DistinctionConfig,
    ) -> bool {
        let is_told = |others: f64| 1.0 / (1.0 + others) >= config.min_wall_confidence;
        let likelihood = |rival: &Hypothesis| (-best.wall_margin(rival, config.alike_share, self.weigh)).exp();
        is_told(rivals.map(likelihood).sum()) && is_told(self.challengers(best).iter().map(likelihood).sum())
    }

    /// Other places than `best` that walls alone suggest. The hypotheses at hand may lack them:
    /// they are weighed by pictures, too, and what is light is dropped.
    fn challengers(&self, best: &Hypothesis) -> Vec<Hypothesis> {
        let Self { views, landmarks, .. } = self;
        let Some((last, pyramid)) = views.last().zip(landmarks.walls().pyramid.as_ref()) else { return Vec::new() };
        let found = pyramid.find(self.points, &[]).into_iter();
        let found = found.filter_map(|rough| held(&rough.map_from_scan, last, landmarks, self.matching));
        let others = found.filter(|at| !best.is_near(at, self.same.0, self.same.1));
        others.map(|at| Hypothesis::traced_back(&at, views, landmarks, self.matching, self.weigh)).collect()
    }
}

/// What pictures say of a place.
#[derive(Default)]
struct Looks {
    pictures: u32,
    /// Sum of how much more they look like the most alike node near than the model's threshold.
    above: f64,
    /// The same, where that node looks like nodes elsewhere, than those do.
    excess: f64,
    /// How much those nodes look like the most alike node elsewhere, cosine.
    elsewhere: BTreeMap<NodeId, f32>,
}

impl Looks {
    /// Adds a view, if it has a picture and there is a node near.
    fn add(&mut self, at: &Pose2, view: &SensedView, landmarks: &Landmarks, radius_m: f64) {
        let distance_m = |id: &NodeId, from: &Pose2| {
            landmarks.get(*id).map(|node| (node.map_from_node.translation.vector - from.translation.vector).norm())
        };
        let near = view.alike.iter().filter(|(id, _)| distance_m(id, at).is_some_and(|metres| metres <= radius_m));
        let Some((id, above)) = near.max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
        let Some((node, descriptor)) = landmarks.get(*id).and_then(|node| Some((node, node.descriptor()?))) else {
            return;
        };
        let elsewhere = *self.elsewhere.entry(*id).or_insert_with(|| {
            let is_elsewhere =
                |id: &NodeId| distance_m(id, &node.map_from_node).is_some_and(|metres| metres > 2.0 * radius_m);
            let others = landmarks.similarities(descriptor).into_iter().filter(|(id, _)| is_elsewhere(id));
            others.map(|(_, similarity)| similarity).fold(f32::NEG_INFINITY, f32::max)
        });
        self.pictures += 1;
        self.above += f64::from(*above);
        self.excess += f64::from(above - (elsewhere - view.match_threshold).max(0.0));
    }

    fn mean(&self, sum: f64) -> f64 {
        sum / f64::from(self.pictures.max(1))
    }
}
