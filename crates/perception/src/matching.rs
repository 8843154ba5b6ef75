//! Scan matching: where was this scan taken, relative to that one?
//!
//! [`search`] needs no initial guess: a correlative search (Olson, "Real-time correlative scan
//! matching", ICRA 2009) over a window of translations and all headings, coarse to fine, then
//! [`refine`], a robust point-to-line ICP (Censi, "An ICP variant using a point-to-line metric",
//! ICRA 2008) with the covariance of its solution. A match is accepted only when both scans explain
//! each other; otherwise the answer is [`NoMatch`].

mod branch_and_bound;
mod cloud;
mod correlative;
mod line_icp;
mod point_index;

pub use branch_and_bound::{BranchAndBoundConfig, Favour, PoseCandidate, WallPyramid};
pub use cloud::{ReferenceCloud, SeenPoint};
pub use correlative::{SearchWindow, alignments, search};
pub use line_icp::{Prior, refine, refine_with_prior};
use serde::{Deserialize, Serialize};

use crate::pose::Pose2;
use nalgebra::Matrix3;

/// Parameters of search and refinement.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MatchConfig {
    /// Translation step of the coarse search, metres. Default 0.2.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 1.0)))]
    pub coarse_step_m: f64,
    /// Heading step of the coarse search, radians. Default 0.05.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0005, max = 1.0)))]
    pub coarse_step_rad: f64,
    /// Coarse candidates that are searched more finely. Default 12.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 10000)))]
    pub candidates: usize,
    /// Points of the moving scan that the coarse search uses. Default 120.
    #[cfg_attr(feature = "schema", schemars(range(min = 1, max = 100000)))]
    pub coarse_points: usize,
    /// Standard deviation of a point's distance to the wall that it belongs to, metres; LiDAR noise
    /// and the chord between beams. Default 0.01.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0001, max = 1.0)))]
    pub point_sigma_m: f64,
    /// Standard deviation of a reference point's normal, radians. Default 0.25.
    pub normal_sigma_rad: f64,
    /// A moving point farther than this from every reference point belongs to none, at the start of
    /// the refinement, metres. Default 0.4.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 10.0)))]
    pub first_reach_m: f64,
    /// The same at the end, metres. Default 0.12.
    #[cfg_attr(feature = "schema", schemars(range(min = 0.001, max = 10.0)))]
    pub last_reach_m: f64,
    /// Iterations of the refinement. Default 20.
    pub max_iterations: usize,
    /// A point is explained when its line is nearer than this, metres. Default 0.06.
    pub explained_m: f64,
    /// Least score for [`search`] to accept. Default 0.6.
    pub min_score: f64,
    /// Fewest points in either scan. Default 40.
    pub min_points: usize,
}

impl Default for MatchConfig {
    fn default() -> Self {
        Self {
            coarse_step_m: 0.2,
            coarse_step_rad: 0.05,
            candidates: 12,
            coarse_points: 120,
            point_sigma_m: 0.01,
            normal_sigma_rad: 0.25,
            first_reach_m: 0.4,
            last_reach_m: 0.12,
            max_iterations: 20,
            explained_m: 0.06,
            min_score: 0.6,
            min_points: 40,
        }
    }
}

/// Where the moving scan lies in the reference's frame.
#[derive(Clone, Debug)]
pub struct ScanMatch {
    /// Pose of the moving scan's frame in the reference's frame.
    pub reference_from_moving: Pose2,
    /// Covariance of x, y (metres, reference frame) and yaw (radians).
    pub covariance: Matrix3<f64>,
    /// Share of the points that are explained by the other scan, 0 to 1; of both directions the
    /// lesser where both can be judged.
    pub score: f64,
}

/// The scans do not match.
#[derive(Clone, Debug, thiserror::Error)]
#[error("the scans do not match: the best alignment explains {:.0} % of the points", best_score * 100.0)]
pub struct NoMatch {
    /// Score of the best alignment found, 0 if there was none.
    pub best_score: f64,
}

#[cfg(test)]
mod tests;
