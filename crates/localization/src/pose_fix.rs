//! The pose of a fix: the optimum over the single estimations of a hypothesis that agree (paper,
//! section III-C-1, equation 10, with wrapped angles).
//!
//! Each view is matched to the map by itself. Estimations that contradict the odometry between them
//! are thrown out; the rest hold a chain of poses to the map, in a robust pose graph.

use crate::agreement::agreement_graph;
use crate::estimate::PlaceEstimate;
use crate::hypotheses::{Hypothesis, SensedView};
use crate::landmarks::Landmarks;
use fht_perception::consensus::{ConsensusConfig, heaviest_clique, members};
use fht_perception::drift::{OdometryDrift, propagate};
use fht_perception::matching::{MatchConfig, refine};
use fht_perception::pose::Pose2;
use fht_perception::pose_graph::{GraphConfig, PoseConstraint, optimise};
use fht_perception::scan_odometry::Odometry;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// How a fix is made.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PoseFixConfig {
    /// Added to the covariance of every match: the map is not exact, metres. Default 0.02.
    pub map_sigma_m: f64,
    /// The same for headings, radians. Default 0.2°.
    pub map_sigma_rad: f64,
    /// Estimations that must agree. Default 2.
    pub min_estimates: usize,
    /// And this share of all. Default 0.6.
    pub min_share: f64,
    /// Views used, the newest. Default 6.
    pub views: usize,
    /// Drift of the odometry.
    pub noise: OdometryDrift,
    /// When estimations agree.
    pub consensus: ConsensusConfig,
    /// The optimisation.
    pub graph: GraphConfig,
}

impl Default for PoseFixConfig {
    fn default() -> Self {
        Self {
            map_sigma_m: 0.02,
            map_sigma_rad: 0.2_f64.to_radians(),
            min_estimates: 2,
            min_share: 0.6,
            views: 6,
            noise: OdometryDrift::default(),
            consensus: ConsensusConfig::default(),
            graph: GraphConfig { doubt_chi2: 12.0, is_graduated: false, ..GraphConfig::default() },
        }
    }
}

/// A pose that the robot stands by.
#[derive(Clone, Debug)]
pub struct Fix {
    /// Map frame from odometry frame (REP-105's map → odom).
    pub map_from_odom: Pose2,
    /// The robot in the map frame when the fix was made.
    pub map_from_base: Pose2,
    /// Covariance of `map_from_base`: x and y (m) in the map frame, yaw (rad).
    pub covariance: Matrix3<f64>,
    /// Probability that it is right, as the robot sees it.
    pub confidence: f64,
    /// Estimations that agree.
    pub estimates: usize,
    /// Estimations made.
    pub views: usize,
}

impl Fix {
    /// Standard deviation of the position along its worst direction, metres.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        self.covariance.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().max().max(0.0).sqrt()
    }
}

/// The fix that a hypothesis gives; `None` if its views do not agree, or the newest with none.
#[must_use]
pub fn fix_pose(
    hypothesis: &Hypothesis,
    views: &[SensedView],
    landmarks: &Landmarks,
    confidence: f64,
    matching: &MatchConfig,
    config: &PoseFixConfig,
) -> Option<Fix> {
    let newest = views.last()?.odometry;
    let recent = views.iter().zip(&hypothesis.at).rev().take(config.views);
    let mut estimates: Vec<PlaceEstimate> =
        recent.filter_map(|(view, guess)| estimate(view, guess, landmarks, matching, config)).collect();
    estimates.reverse();
    let count = estimates.len();
    let graph = agreement_graph(&estimates, &config.noise, &config.consensus);
    let scores: Vec<f64> = estimates.iter().map(|estimate| estimate.score).collect();
    let agreeing = heaviest_clique(&graph, &scores, u64::MAX);
    let chosen: Vec<PlaceEstimate> = members(agreeing).filter_map(|index| estimates.get(index).cloned()).collect();
    if chosen.len() < config.min_estimates || (chosen.len() as f64) < config.min_share * count as f64 {
        return None;
    }
    // Where the odometry has just slipped, the newest scan contradicts the rest: the others say
    // where the robot was, and not where it is.
    let agrees =
        |estimate: &PlaceEstimate| (estimate.odometer_m, estimate.turned_rad) == (newest.odometer_m, newest.turned_rad);
    if !chosen.last().is_some_and(agrees) {
        return None;
    }
    let map_from_base = optimum(&chosen, &newest, config)?;
    Some(Fix {
        map_from_odom: map_from_base * newest.odom_from_base.inverse(),
        map_from_base,
        covariance: covariance(&chosen, &map_from_base, &newest, config)?,
        confidence,
        estimates: chosen.len(),
        views: count,
    })
}

/// The paper's single estimation, against all nodes at once.
fn estimate(
    view: &SensedView,
    guess: &Pose2,
    landmarks: &Landmarks,
    matching: &MatchConfig,
    config: &PoseFixConfig,
) -> Option<PlaceEstimate> {
    let found = refine(&landmarks.walls().cloud, &view.points, guess, matching)?;
    let (m, rad) = (config.map_sigma_m.powi(2), config.map_sigma_rad.powi(2));
    (found.score >= matching.min_score).then(|| PlaceEstimate {
        map_from_base: found.reference_from_moving,
        covariance: found.covariance + Matrix3::from_diagonal(&Vector3::new(m, m, rad)),
        odom_from_base: view.odometry.odom_from_base,
        odometer_m: view.odometry.odometer_m,
        turned_rad: view.odometry.turned_rad,
        score: found.score,
    })
}

/// The robot's pose now: a chain of poses, joined by odometry and held to the map by the
/// estimations.
fn optimum(chosen: &[PlaceEstimate], newest: &Odometry, config: &PoseFixConfig) -> Option<Pose2> {
    // Pose 0 is the map's frame.
    let mut poses = vec![Pose2::identity()];
    let mut edges = Vec::new();
    for (index, estimate) in chosen.iter().enumerate() {
        poses.push(estimate.map_from_base);
        edges.push(PoseConstraint {
            from: 0,
            to: index + 1,
            measured: estimate.map_from_base,
            information: estimate.covariance.try_inverse()?,
            is_doubtful: true,
        });
        let next = match chosen.get(index + 1) {
            Some(next) => (next.odom_from_base, next.odometer_m, next.turned_rad),
            None => (newest.odom_from_base, newest.odometer_m, newest.turned_rad),
        };
        let (driven, turned) = ((next.1 - estimate.odometer_m).abs(), (next.2 - estimate.turned_rad).abs());
        let (sigma_m, sigma_rad) = config.noise.sigmas(driven, turned);
        let diagonal = Vector3::new(sigma_m.powi(-2), sigma_m.powi(-2), sigma_rad.powi(-2));
        edges.push(PoseConstraint {
            from: index + 1,
            to: index + 2,
            measured: estimate.odom_from_base.inverse() * next.0,
            information: Matrix3::from_diagonal(&diagonal),
            is_doubtful: false,
        });
    }
    let last = chosen.last()?;
    poses.push(last.map_from_base * (last.odom_from_base.inverse() * newest.odom_from_base));
    optimise(&mut poses, &edges, &config.graph).ok()?;
    poses.last().copied()
}

/// Covariance of the pose now: each estimation brought along the odometry, all of them together.
fn covariance(
    chosen: &[PlaceEstimate],
    map_from_base: &Pose2,
    newest: &Odometry,
    config: &PoseFixConfig,
) -> Option<Matrix3<f64>> {
    let mut information = Matrix3::zeros();
    for estimate in chosen {
        let driven = (newest.odometer_m - estimate.odometer_m).abs();
        let turned = (newest.turned_rad - estimate.turned_rad).abs();
        let brought =
            propagate(&estimate.covariance, &estimate.map_from_base, map_from_base, &config.noise, driven, turned);
        information += brought.try_inverse()?;
    }
    // The map's own error is common to all of them: it does not average out.
    let (m, rad) = (config.map_sigma_m.powi(2), config.map_sigma_rad.powi(2));
    Some(information.try_inverse()? + Matrix3::from_diagonal(&Vector3::new(m, m, rad)))
}
