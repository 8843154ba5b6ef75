//! Whether the likeliest place can be told from one that the map does not have.
//!
//! A room that is not on the map may be like one that is. Where the walls alone decide, such a room
//! would have to be the same to the decimetre. Where they leave a tie, as in a rectangle that fits
//! in two ways, something like it may be anywhere, and pictures that merely favour one way over the
//! other prove nothing: they must look like that place and like no other.

use crate::hypotheses::{Hypothesis, SensedView, WeighConfig};
use crate::landmarks::Landmarks;
use fht_perception::pose::Pose2;
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
        Self { min_wall_confidence: 0.97, min_excess: 0.2, max_deficit: 0.05, min_pictures: 3 }
    }
}

/// Whether walls or pictures tell `best` from all `rivals`, and from places that the map does not
/// have.
pub(crate) fn is_distinct<'a>(
    best: &Hypothesis,
    rivals: impl Iterator<Item = &'a Hypothesis>,
    views: &[SensedView],
    landmarks: &Landmarks,
    weigh: &WeighConfig,
    config: &DistinctionConfig,
) -> bool {
    let walls = best.wall_weight(weigh);
    let others: f64 = rivals.map(|rival| (rival.wall_weight(weigh) - walls).exp()).sum();
    let wall_confidence = 1.0 / (1.0 + others);
    let mut looks = Looks::default();
    for (at, view) in best.at.iter().zip(views) {
        looks.add(at, view, landmarks, weigh.look_radius_m);
    }
    let (above, excess) = (looks.mean(looks.above), looks.mean(looks.excess));
    tracing::debug!(wall_confidence, pictures = looks.pictures, above, excess, "told from places not on the map");
    let is_seen = looks.pictures >= config.min_pictures;
    let is_like_another_place = is_seen && above < -config.max_deficit;
    let is_like_no_other = is_seen && excess >= config.min_excess;
    !is_like_another_place && (wall_confidence >= config.min_wall_confidence || is_like_no_other)
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
