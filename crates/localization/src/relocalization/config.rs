//! How the robot finds out where it is.

use crate::confidence::ConfidenceConfig;
use crate::distinction::DistinctionConfig;
use crate::hypotheses::WeighConfig;
use crate::pose_fix::PoseFixConfig;
use crate::votes::RivalConfig;
use fht_perception::matching::MatchConfig;
use serde::{Deserialize, Serialize};

/// How the robot finds out where it is.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RelocalizationConfig {
    /// Least cosine between descriptors of one place (the paper's th_match); `None`: what the map
    /// says of its model. Default `None`.
    pub min_similarity: Option<f32>,
    /// Nodes that look most alike favour the places around them. Default 6.
    pub favoured: usize,
    /// As far as this, metres. Default 4.
    pub favour_radius_m: f64,
    /// They are worth this share of a scan's points at most. Default 0.15.
    pub favour: f64,
    /// Views are this far apart, metres. Default 0.8.
    pub view_spacing_m: f64,
    /// Views kept. Default 12.
    pub views: usize,
    /// Views taken on this much of the way are looked for together, metres. Default 4.
    pub search_memory_m: f64,
    /// Hypotheses kept. Default 16.
    pub hypotheses: usize,
    /// Hypotheses held to the walls at each view, heaviest first; the others follow the odometry.
    /// Default 6.
    pub held: usize,
    /// A hypothesis that weighs less than the heaviest by this much is dropped, natural logarithm.
    /// Default 15.
    pub drop_below: f64,
    /// Nearer than this is the same place, metres. Default 0.5.
    pub same_m: f64,
    /// The same for headings, radians. Default 0.25.
    pub same_rad: f64,
    /// Side of the pieces of wall that count as one, metres. Default 0.5.
    pub square_m: f64,
    /// When a rival may be a place that was mapped in part only.
    pub rivals: RivalConfig,
    /// How probable a place is.
    pub confidence: ConfidenceConfig,
    /// A fix is at least this probable. Default 0.982, at a ground of 1.
    pub min_confidence: f64,
    /// Greatest share of beams that cannot be; among people, of pieces of wall. Default 0.04: where
    /// nothing was moved it is below 0.01, and in rooms that no main node looked into the best that
    /// is found elsewhere has 0.05 and more.
    pub max_contradicted: f64,
    /// For each who has walked by of late, so many pieces of wall may be somebody's who stands: of
    /// those that are narrow, stand alone and are not on the map. Default 4.
    pub pieces_per_walker: f64,
    /// A fix that rests on that is at least this probable. Default 0.995.
    pub min_confidence_among_people: f64,
    /// Greatest standard deviation of the declared position along any direction, metres. Default
    /// 0.15.
    pub max_sigma_m: f64,
    /// Weights of hypotheses.
    pub weigh: WeighConfig,
    /// What tells a place from those that the map does not have.
    pub distinction: DistinctionConfig,
    /// The pose of a fix.
    pub pose_fix: PoseFixConfig,
    /// The scan matching; its least score is that of an estimation.
    pub matching: MatchConfig,
}

impl Default for RelocalizationConfig {
    fn default() -> Self {
        Self {
            min_similarity: None,
            favoured: 6,
            favour_radius_m: 4.0,
            favour: 0.15,
            view_spacing_m: 0.8,
            views: 12,
            search_memory_m: 4.0,
            hypotheses: 16,
            held: 6,
            drop_below: 15.0,
            same_m: 0.5,
            same_rad: 0.25,
            square_m: 0.5,
            rivals: RivalConfig::default(),
            confidence: ConfidenceConfig::default(),
            min_confidence: 0.982,
            max_contradicted: 0.04,
            pieces_per_walker: 4.0,
            min_confidence_among_people: 0.995,
            max_sigma_m: 0.15,
            weigh: WeighConfig::default(),
            distinction: DistinctionConfig::default(),
            pose_fix: PoseFixConfig::default(),
            matching: MatchConfig { min_score: 0.45, ..MatchConfig::default() },
        }
    }
}
