//! Parameters of loop closure.

use fht_perception::matching::MatchConfig;
use fht_perception::pose_graph::GraphConfig;
use serde::{Deserialize, Serialize};

/// Parameters of loop closure.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ClosureConfig {
    /// The optimisation.
    pub graph: GraphConfig,
    /// Scan matching.
    pub matching: MatchConfig,
    /// A submap is tried when one of its keyframes is nearer than this plus the uncertainty,
    /// metres. Default 4.
    pub reach_m: f64,
    /// Half width of the search after no way at all, metres. Default 0.15.
    pub window_m: f64,
    /// Nodes of the map, made by other robots, that a keyframe is matched to: the nearest. Default
    /// 2.
    pub anchors: usize,
    /// Growth of the half width with the length of the way since both places were joined, metres
    /// per metre. Default 0.03.
    pub window_per_m: f64,
    /// Greatest half width, metres. Default 10.
    pub max_window_m: f64,
    /// Half width of headings after no way at all, radians. Default 0.05.
    pub window_rad: f64,
    /// Growth of the half width of headings, radians per metre. Default 0.01.
    pub window_rad_per_m: f64,
    /// Up to this half width refinement needs no search, metres. Default 0.45.
    pub refine_m: f64,
    /// Submaps tried with each keyframe by refinement. Default 8.
    pub tries: usize,
    /// Keyframes between searches. Default 4.
    pub search_every: usize,
    /// Keyframes between searches in all submaps that may be near, where the half width would be
    /// greater than the greatest. Default 16.
    pub wide_every: usize,
    /// Growth of the half width of that search with the length of the way, metres per metre.
    /// Default 0.1.
    pub wide_window_per_m: f64,
    /// Growth of the half width of headings in that search, radians per square root of a metre:
    /// four times what the wheels' heading is believed to walk. Default 0.035 (2°).
    pub wide_rad_per_sqrt_m: f64,
    /// Least explained share of the points that a submap can judge. Default 0.8.
    pub min_agreement: f64,
    /// Least explained share of all points. Default 0.4.
    pub min_overlap: f64,
    /// The same of a match after a long way that is no closure for itself, but a witness among
    /// others. Default 0.65.
    pub doubtful_agreement: f64,
    /// See `doubtful_agreement`. Default 0.2.
    pub doubtful_overlap: f64,
    /// Closures after a long way that must agree. Default 3.
    pub agreeing: usize,
    /// So many doubtful ones count as one of these. Default 2.
    pub doubtful_per_sure: usize,
    /// They agree when the corrections that they imply differ by less than this, metres. Default
    /// 0.3.
    pub agreement_m: f64,
    /// And by less than this, radians. Default 0.05.
    pub agreement_rad: f64,
    /// Standard deviation of a match beyond what its geometry says, metres: neighbouring matches
    /// err alike. Default 0.01.
    pub floor_m: f64,
    /// The same for the heading, radians. Default 0.002.
    pub floor_rad: f64,
    /// The graph is optimised when new closures disagree with it by this much in sum (squared
    /// Mahalanobis distance). Default 5: waiting for more, what the robot knows of itself wanders
    /// by twice as much (office).
    pub optimise_tension: f64,
    /// What one closure adds to that sum at most. Default 50.
    pub most_tension: f64,
    /// Least cosine of the descriptors of two panoramas that may be of one place; `None`: what the
    /// model says. Default `None`.
    pub min_similarity: Option<f32>,
    /// A look-alike is tried when the way to it is longer than this, metres. Default 15.
    pub look_alike_way_m: f64,
    /// Half width of the search around a look-alike, metres. Default 2.5.
    pub look_alike_m: f64,
    /// Half width of the search in each submap when the robot is lost, metres. Default 6.
    pub lost_window_m: f64,
    /// Least agreement and overlap of a place that a lost robot believes. Default 0.85 and 0.6.
    pub lost_agreement: f64,
    /// See `lost_agreement`.
    pub lost_overlap: f64,
    /// A lost robot believes no place when another one has more than this share of its balance.
    /// Default 0.8.
    pub lost_ambiguity: f64,
}

impl Default for ClosureConfig {
    fn default() -> Self {
        Self {
            graph: GraphConfig::default(),
            matching: MatchConfig::default(),
            reach_m: 4.0,
            anchors: 2,
            window_m: 0.15,
            window_per_m: 0.03,
            max_window_m: 10.0,
            window_rad: 0.05,
            window_rad_per_m: 0.01,
            refine_m: 0.45,
            tries: 8,
            search_every: 4,
            wide_every: 16,
            wide_window_per_m: 0.1,
            wide_rad_per_sqrt_m: 0.035,
            min_agreement: 0.8,
            min_overlap: 0.4,
            doubtful_agreement: 0.65,
            doubtful_overlap: 0.2,
            agreeing: 3,
            doubtful_per_sure: 2,
            agreement_m: 0.3,
            agreement_rad: 0.05,
            floor_m: 0.01,
            floor_rad: 0.002,
            optimise_tension: 5.0,
            most_tension: 50.0,
            min_similarity: None,
            look_alike_way_m: 15.0,
            look_alike_m: 2.5,
            lost_window_m: 6.0,
            lost_agreement: 0.85,
            lost_overlap: 0.6,
            lost_ambiguity: 0.8,
        }
    }
}
