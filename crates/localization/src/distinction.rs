//! Whether the likeliest place can be told from one that the map does not have.
//!
//! A room that is not on the map may be like one that is. Where the walls alone decide, such a room
//! would have to be the same to the decimetre. Where they leave a tie, as in a rectangle that fits
//! in two ways, something like it may be anywhere, and pictures that merely favour one way over the
//! other prove nothing: they must look like that place and like no other.

use crate::hypotheses::{Hypothesis, SensedView, WeighConfig, held, is_near, odometry_poses, points_seen};
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
    /// They look like the nodes near by this much more than like those near a rival, cosine, or the
    /// walls must tell the rival. Default 0.1.
    pub min_excess_over_rival: f64,
    /// Whatever the walls say, pictures of a known place are at most this much below the model's
    /// threshold, cosine. Default 0.05.
    pub max_deficit: f64,
    /// Pictures that must have been taken for either. Default 3.
    pub min_pictures: u32,
}

impl Default for DistinctionConfig {
    fn default() -> Self {
        Self {
            min_wall_confidence: 0.97,
            alike_share: 0.03,
            min_excess: 0.2,
            min_excess_over_rival: 0.1,
            max_deficit: 0.05,
            min_pictures: 3,
        }
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

    /// Whether pictures tell `best` from `rival`: they were taken near nodes that they look like
    /// more than they look like the nodes near the rival.
    pub fn pictures_tell_from(&self, best: &Hypothesis, rival: &Hypothesis, config: &DistinctionConfig) -> bool {
        let radius_m = self.weigh.look_radius_m;
        let pairs = best.at.iter().zip(&rival.at).zip(self.views);
        let more: Vec<f64> = pairs
            .filter_map(|((here, there), view)| {
                let (_, here) = most_alike(here, view, self.landmarks, radius_m)?;
                let (_, there) = most_alike(there, view, self.landmarks, radius_m)?;
                Some(f64::from(here - there))
            })
            .collect();
        let mean = more.iter().sum::<f64>() / (more.len() as f64).max(1.0);
        more.len() >= config.min_pictures as usize && mean >= config.min_excess_over_rival
    }

    /// Whether walls alone tell `best` from all `rivals`.
    pub fn walls_tell<'a>(
        &self,
        best: &Hypothesis,
        rivals: impl Iterator<Item = &'a Hypothesis>,
        config: &DistinctionConfig,
    ) -> bool {
        let likelihood = |rival: &Hypothesis| (-best.wall_margin(rival, config.alike_share, self.weigh)).exp();
        1.0 / (1.0 + rivals.map(likelihood).sum::<f64>()) >= config.min_wall_confidence
    }

    /// Other places than `best` that walls alone suggest. The hypotheses at hand may lack them:
    /// they are weighed by pictures, too, and what is light is dropped. In a corridor the last view
    /// does not say how far along it the robot is; all that was seen on the way may. `lately` are
    /// the end points seen of late, in the frame of the last view.
    pub fn challengers(&self, best: &Hypothesis, lately: &[Point2], config: &DistinctionConfig) -> Vec<Hypothesis> {
        let Self { views, landmarks, .. } = self;
        let way = &points_seen(views, &odometry_poses(views), f64::INFINITY);
        let Some((last, pyramid)) = views.last().zip(landmarks.walls().pyramid.as_ref()) else { return Vec::new() };
        let rough = [lately, way].into_iter().flat_map(|points| pyramid.find(points, &[]));
        let found = rough.filter_map(|rough| {
            let at = held(&rough.map_from_scan, &last.points, landmarks, self.matching)?;
            Some(held(&at, way, landmarks, self.matching).unwrap_or(at))
        });
        let mut others: Vec<Pose2> = Vec::new();
        for at in found.filter(|at| !best.is_near(at, self.same.0, self.same.1)) {
            if !others.iter().any(|other| is_near(other, &at, SAME_CHALLENGER_M, SAME_CHALLENGER_RAD)) {
                others.push(at);
            }
        }
        let way_of_best = points_seen(views, &best.at, f64::INFINITY);
        let mut challengers: Vec<Hypothesis> = Vec::new();
        for at in &others {
            let challenger = self.challenger(at, best, &way_of_best, config);
            let at = challenger.map_from_base();
            if !challengers.iter().any(|other| other.is_near(&at, SAME_CHALLENGER_M, SAME_CHALLENGER_RAD)) {
                challengers.push(challenger);
            }
        }
        challengers
    }

    /// What challenges `best` around `at`, by its walls as strong as it can be. Each view held to
    /// the walls for itself slides along the one wall that it sees, and odometry drifts. The way of
    /// `best` is held to walls already: if something like that room is here, too, it fits here.
    fn challenger(
        &self,
        at: &Pose2,
        best: &Hypothesis,
        way_of_best: &[Point2],
        config: &DistinctionConfig,
    ) -> Hypothesis {
        let Self { views, landmarks, matching, weigh, .. } = self;
        let traced = Hypothesis::traced_back(at, views, landmarks, matching, weigh);
        let at = held(at, way_of_best, landmarks, matching).unwrap_or(*at);
        if best.is_near(&at, self.same.0, self.same.1) {
            return traced; // it slid to where nothing is challenged
        }
        let as_best = Hypothesis::driven_as(&at, best, views, landmarks, weigh);
        let margin = |challenger: &Hypothesis| best.wall_margin(challenger, config.alike_share, weigh);
        if margin(&as_best) < margin(&traced) { as_best } else { traced }
    }
}

/// Challengers nearer to each other than this are one, metres.
const SAME_CHALLENGER_M: f64 = 0.05;
/// The same for headings, radians.
const SAME_CHALLENGER_RAD: f64 = 0.02;

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
        let Some((id, above)) = most_alike(at, view, landmarks, radius_m) else { return };
        let Some((node, descriptor)) = landmarks.get(id).and_then(|node| Some((node, node.descriptor()?))) else {
            return;
        };
        let elsewhere = *self.elsewhere.entry(id).or_insert_with(|| {
            let is_elsewhere = |id: &NodeId| {
                distance_m(*id, &node.map_from_node, landmarks).is_some_and(|metres| metres > 2.0 * radius_m)
            };
            let others = landmarks.similarities(descriptor).into_iter().filter(|(id, _)| is_elsewhere(id));
            others.map(|(_, similarity)| similarity).fold(f32::NEG_INFINITY, f32::max)
        });
        self.pictures += 1;
        self.above += f64::from(above);
        self.excess += f64::from(above - (elsewhere - view.match_threshold).max(0.0));
    }

    fn mean(&self, sum: f64) -> f64 {
        sum / f64::from(self.pictures.max(1))
    }
}

/// The node within `radius_m` of `at` that a view looks most like, and by how much more than the
/// model's threshold, cosine.
fn most_alike(at: &Pose2, view: &SensedView, landmarks: &Landmarks, radius_m: f64) -> Option<(NodeId, f32)> {
    let is_near = |id: NodeId| distance_m(id, at, landmarks).is_some_and(|metres| metres <= radius_m);
    let near = view.alike.iter().copied().filter(|(id, _)| is_near(*id));
    near.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn distance_m(id: NodeId, from: &Pose2, landmarks: &Landmarks) -> Option<f64> {
    landmarks.get(id).map(|node| (node.map_from_node.translation.vector - from.translation.vector).norm())
}
