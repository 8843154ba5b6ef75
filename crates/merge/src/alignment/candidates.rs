//! Place recognition: where in the other map could this have been seen?
//!
//! What a node and its neighbours saw is looked for in the whole other map at once; nodes that look
//! alike favour the places around them. Rooms that are alike give several answers, and all of them
//! are kept.

use crate::alignment::prepared_map::{PreparedMap, PreparedNode};
use fht_map::MapState;
use fht_perception::drift::difference;
use fht_perception::evidence_grid::{Evidence, EvidenceConfig};
use fht_perception::matching::{Favour, MatchConfig, refine};
use fht_perception::pose::Pose2;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// How single places are looked for.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct CandidateConfig {
    /// Places looked for, evenly spread over the map's main nodes. Default 120.
    pub places: usize,
    /// Main nodes whose scans are looked for together. Default 6.
    pub together: usize,
    /// They are at most this far from the first, metres. Default 5.
    pub together_m: f64,
    /// Nodes that look alike favour the places within this, metres. Default 4.
    pub favour_radius_m: f64,
    /// They are worth this share of a scan's points at most. Default 0.15.
    pub favour: f64,
    /// They are worth that when the cosine is this far above what the model calls near, nothing
    /// this far below. Default 0.1.
    pub look_span: f64,
    /// Nodes that favour, those that look most alike. Default 6.
    pub favoured: usize,
    /// Refinement may move what was found by at most this, metres. Default 0.5.
    pub refined_m: f64,
    /// And turn it by this, radians. Default 0.2.
    pub refined_rad: f64,
    /// Greatest share of contradicted beams among those that say something. Default 0.25: furniture
    /// may have moved.
    pub max_contradicted: f64,
    /// Least share of all beams that are explained. Default 0.35: the maps may overlap in part.
    pub min_explained: f64,
    /// Kept for each place, those that explain most. Default 8.
    pub kept: usize,
    /// Added to the covariance of every match: neither map is exact, metres. Default 0.02.
    pub map_sigma_m: f64,
    /// The same for headings, radians. Default 0.2°.
    pub map_sigma_rad: f64,
    /// The scan matching; its least score is that of a match.
    pub matching: MatchConfig,
}

impl Default for CandidateConfig {
    fn default() -> Self {
        Self {
            places: 120,
            together: 6,
            together_m: 5.0,
            favour_radius_m: 4.0,
            favour: 0.15,
            look_span: 0.1,
            favoured: 6,
            refined_m: 0.5,
            refined_rad: 0.2,
            max_contradicted: 0.25,
            min_explained: 0.35,
            kept: 8,
            map_sigma_m: 0.02,
            map_sigma_rad: 0.2_f64.to_radians(),
            matching: MatchConfig { min_score: 0.45, ..MatchConfig::default() },
        }
    }
}

/// A place of `b` that was found in `a`.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// Which of `b`'s places.
    pub(crate) place: usize,
    pub(crate) a_from_node: Pose2,
    pub(crate) covariance: Matrix3<f64>,
    /// How much speaks for it, 0 to 1.
    pub(crate) weight: f64,
}

/// Beams for and against among those that say something, as a share of contradiction.
pub(crate) fn contradiction(evidence: &Evidence) -> f64 {
    evidence.contradicted as f64 / (evidence.explained + evidence.contradicted).max(1) as f64
}

impl CandidateConfig {
    /// Where a scan is, held to the walls of a map; `None` where too little fits, or when that is
    /// another place.
    pub(crate) fn held(
        &self,
        walls: &PreparedMap<'_>,
        place: &PreparedNode<'_>,
        guess: &Pose2,
    ) -> Option<(Pose2, Matrix3<f64>)> {
        let found = refine(&walls.walls.cloud, &place.points, guess, &self.matching)?;
        let gap = difference(&found.reference_from_moving, guess);
        let is_same = gap.xy().norm() <= self.refined_m && gap.z.abs() <= self.refined_rad;
        let (m, rad) = (self.map_sigma_m.powi(2), self.map_sigma_rad.powi(2));
        let floor = Matrix3::from_diagonal(&Vector3::new(m, m, rad));
        let is_good = is_same && found.score >= self.matching.min_score;
        is_good.then(|| (found.reference_from_moving, found.covariance + floor))
    }
}

/// Where the places of `b` may be in `a`. `models` says what the maps call near.
pub(crate) fn candidates(
    a: &PreparedMap<'_>,
    b: &PreparedMap<'_>,
    models: &MapState,
    config: &CandidateConfig,
    beams: &EvidenceConfig,
) -> Vec<Candidate> {
    let Some(pyramid) = &a.walls.pyramid else { return Vec::new() };
    let count = config.places.min(b.places.len());
    let chosen = (0..count).map(|number| number * b.places.len() / count);
    let mut found = Vec::new();
    for place in chosen {
        let around = b.around(place, config.together, config.together_m);
        let seen = b.seen_around(place, &around);
        let favours = favours(a, &b.places[place], models, config);
        let evidence_at = |a_from_node: &Pose2| {
            let a_from_b = a_from_node * b.places[place].map_from_node.inverse();
            let mut sum = Evidence::default();
            for other in around.iter().map(|&other| &b.places[other]) {
                sum.add(a.walls.known.weigh(&other.beams, &(a_from_b * other.map_from_node), beams));
            }
            sum
        };
        let mut here: Vec<Candidate> = Vec::new();
        for alignment in pyramid.find(&seen, &favours) {
            // Half a cell off, the true place looks worse than it is, but not as bad as this.
            if contradiction(&evidence_at(&alignment.map_from_scan)) > 2.0 * config.max_contradicted {
                continue;
            }
            let Some((a_from_node, covariance)) = config.held(a, &b.places[place], &alignment.map_from_scan) else {
                continue;
            };
            let evidence = evidence_at(&a_from_node);
            let weight = evidence.explained_share();
            let is_good = weight >= config.min_explained && contradiction(&evidence) <= config.max_contradicted;
            let is_known = |other: &Candidate| difference(&other.a_from_node, &a_from_node).norm() < 0.1;
            if is_good && !here.iter().any(is_known) {
                here.push(Candidate { place, a_from_node, covariance, weight });
            }
        }
        here.sort_by(|one, other| other.weight.total_cmp(&one.weight));
        here.truncate(config.kept);
        found.extend(here);
    }
    found
}

/// The places in `a` that look like one of `b`.
fn favours(a: &PreparedMap<'_>, place: &PreparedNode<'_>, models: &MapState, config: &CandidateConfig) -> Vec<Favour> {
    let Some(descriptor) = place.descriptor else { return Vec::new() };
    let model = models.models().find(|model| model.id == descriptor.model);
    let near = model.map_or(0.0, |model| f64::from(model.match_threshold_e3) / 1000.0);
    let mut alike: Vec<Favour> = a
        .places
        .iter()
        .filter_map(|other| {
            let above = f64::from(other.descriptor?.similarity(descriptor)?) - near + config.look_span;
            let share = (above / (2.0 * config.look_span)).min(1.0);
            let bonus = config.favour * share;
            (share > 0.0).then(|| Favour { centre: other.position(), radius_m: config.favour_radius_m, bonus })
        })
        .collect();
    alike.sort_by(|one, other| other.bonus.total_cmp(&one.bonus));
    alike.truncate(config.favoured);
    alike
}
