//! Keeping the pose right while driving: each scan against what all main nodes saw, fused with
//! odometry (a Kalman filter).

use crate::landmarks::Landmarks;
use fht_perception::drift::{OdometryDrift, difference, propagate};
use fht_perception::evidence_grid::{Beams, EvidenceConfig};
use fht_perception::frame::LaserScan;
use fht_perception::matching::{MatchConfig, refine};
use fht_perception::pose::{Point2, Pose2, pose, wrap_angle};
use fht_perception::scan_odometry::Odometry;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// How a pose is tracked.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct TrackingConfig {
    /// Least share of the scan explained by the walls. Default 0.3.
    pub min_score: f64,
    /// A scan of which more than this share cannot be holds nothing. Default 0.25: people and moved
    /// furniture stand about.
    pub max_contradicted: f64,
    /// Lost when this share cannot be in the running mean of the scans. Default 0.2.
    pub lost_contradicted: f64,
    /// Lost when less than this share is explained in the running mean, although the map knows the
    /// place. Default 0.4.
    pub lost_explained: f64,
    /// Weight of a scan in the running means. Default 0.15.
    pub scan_weight: f64,
    /// Greatest squared Mahalanobis distance of a measurement. Default 16.27 (χ², 99.9 %, 3
    /// degrees of freedom).
    pub gate: f64,
    /// Added to every measurement's sigma, since walls are not exactly where the map says, metres.
    /// Default 0.02.
    pub map_sigma_m: f64,
    /// The same for headings, radians. Default 0.2°.
    pub map_sigma_rad: f64,
    /// Lost when the position's sigma grows beyond this, metres. Default 0.6.
    pub lost_sigma_m: f64,
    /// Drift of the odometry.
    pub noise: OdometryDrift,
    /// How beams are counted.
    pub evidence: EvidenceConfig,
    /// The refinement.
    pub matching: MatchConfig,
}

impl Default for TrackingConfig {
    fn default() -> Self {
        Self {
            min_score: 0.3,
            max_contradicted: 0.25,
            lost_contradicted: 0.2,
            lost_explained: 0.4,
            scan_weight: 0.15,
            gate: 16.27,
            map_sigma_m: 0.02,
            map_sigma_rad: 0.2_f64.to_radians(),
            lost_sigma_m: 0.6,
            noise: OdometryDrift::default(),
            evidence: EvidenceConfig::default(),
            matching: MatchConfig::default(),
        }
    }
}

/// Why a robot gave up the place that it knew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LostReason {
    /// Nothing held the pose for too long: the standard deviation of its position, metres.
    Uncertain(f64),
    /// Share of what the scanner sees that cannot be seen from there, 0 to 1.
    Contradicted(f64),
    /// Share of it that the map explains, 0 to 1.
    Unexplained(f64),
    /// The place was one of another map.
    MapReplaced,
}

impl std::fmt::Display for LostReason {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Uncertain(sigma_m) => {
                write!(formatter, "no wall has held its position, which is known to {sigma_m:.1} m")
            }
            Self::Contradicted(share) => {
                write!(formatter, "{:.0} % of what it sees cannot be seen from there", 100.0 * share)
            }
            Self::Unexplained(share) => {
                write!(formatter, "the map explains only {:.0} % of what it sees", 100.0 * share)
            }
            Self::MapReplaced => formatter.write_str("another map has come to the name of the one that it was on"),
        }
    }
}

/// A tracked pose.
pub struct Tracker {
    config: TrackingConfig,
    map_from_base: Pose2,
    covariance: Matrix3<f64>,
    at: Odometry,
    /// Running mean of the share of beams that cannot be.
    contradicted: f64,
    /// Running mean of the share of explained beams among those that end where the map knows
    /// something.
    explained: f64,
}

impl Tracker {
    /// Starts at a fix made at `at`.
    #[must_use]
    pub fn new(config: TrackingConfig, map_from_base: Pose2, covariance: Matrix3<f64>, at: Odometry) -> Self {
        Self { config, map_from_base, covariance, at, contradicted: 0.0, explained: 1.0 }
    }

    /// The robot in the map frame.
    #[must_use]
    pub fn map_from_base(&self) -> Pose2 {
        self.map_from_base
    }

    /// Map frame from odometry frame.
    #[must_use]
    pub fn map_from_odom(&self) -> Pose2 {
        self.map_from_base * self.at.odom_from_base.inverse()
    }

    /// Standard deviation of the position along its worst direction, metres.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        self.covariance.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// Why the pose can no longer be stood by, if it cannot.
    #[must_use]
    pub fn lost(&self) -> Option<LostReason> {
        // Any comparison with NaN is false, so it is asked the other way round.
        let is_known =
            self.covariance.iter().all(|value| value.is_finite()) && self.sigma_m() <= self.config.lost_sigma_m;
        if !is_known {
            return Some(LostReason::Uncertain(self.sigma_m()));
        }
        if self.contradicted > self.config.lost_contradicted {
            return Some(LostReason::Contradicted(self.contradicted));
        }
        (self.explained < self.config.lost_explained).then_some(LostReason::Unexplained(self.explained))
    }

    /// Moves the pose by odometry.
    pub fn predict(&mut self, now: &Odometry) {
        let moved = self.at.odom_from_base.inverse() * now.odom_from_base;
        let to = self.map_from_base * moved;
        // Noise of a short step: the floors stand for two far instants and would count again at
        // every frame.
        let noise = OdometryDrift { position_floor_m: 1e-4, yaw_floor_rad: 1e-5, ..self.config.noise.clone() };
        let (driven, turned) = (now.odometer_m - self.at.odometer_m, now.turned_rad - self.at.turned_rad);
        self.covariance = propagate(&self.covariance, &self.map_from_base, &to, &noise, driven, turned);
        self.map_from_base = to;
        self.at = *now;
    }

    /// Matches a scan taken at the pose of the last [`Tracker::predict`] to the map. True if it
    /// held the pose.
    pub fn update(&mut self, landmarks: &Landmarks, points: &[Point2], scan: &LaserScan) -> bool {
        let config = &self.config;
        let walls = landmarks.walls();
        let measured = refine(&walls.cloud, points, &self.map_from_base, &config.matching);
        let measured = measured.filter(|found| found.score >= config.min_score);
        let at = measured.as_ref().map_or(self.map_from_base, |found| found.reference_from_moving);
        let evidence = walls.known.weigh(&Beams::of(scan, &config.evidence), &at, &config.evidence);
        self.contradicted += config.scan_weight * (evidence.contradicted_share() - self.contradicted);
        let heard = evidence.explained + evidence.contradicted;
        if heard > 0 {
            let share = evidence.explained as f64 / heard as f64;
            self.explained += config.scan_weight * (share - self.explained);
        }
        if evidence.contradicted_share() > config.max_contradicted {
            return false;
        }
        let (m, rad) = (config.map_sigma_m.powi(2), config.map_sigma_rad.powi(2));
        let of_map = Matrix3::from_diagonal(&Vector3::new(m, m, rad));
        measured.is_some_and(|found| self.fuse(&found.reference_from_moving, &(found.covariance + of_map)))
    }

    /// Kalman update with a pose; false if it lies outside the gate.
    fn fuse(&mut self, measured: &Pose2, covariance: &Matrix3<f64>) -> bool {
        let innovation = difference(measured, &self.map_from_base);
        let Some(inverse) = (self.covariance + covariance).try_inverse() else { return false };
        if innovation.dot(&(inverse * innovation)) > self.config.gate {
            return false;
        }
        let gain = self.covariance * inverse;
        let by = gain * innovation;
        let at = &self.map_from_base;
        let yaw = wrap_angle(at.rotation.angle() + by.z);
        self.map_from_base = pose(at.translation.x + by.x, at.translation.y + by.y, yaw);
        // Joseph's form keeps it symmetric and positive.
        let keep = Matrix3::identity() - gain;
        self.covariance = keep * self.covariance * keep.transpose() + gain * covariance * gain.transpose();
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covariance_that_is_not_finite_is_lost() {
        let at = Odometry { odom_from_base: pose(0.0, 0.0, 0.0), odometer_m: 0.0, turned_rad: 0.0, is_keyframe: true };
        let tracker = |sigma: f64| {
            let covariance = Matrix3::from_diagonal(&Vector3::new(sigma * sigma, 0.01, 0.001));
            Tracker::new(TrackingConfig::default(), pose(0.0, 0.0, 0.0), covariance, at)
        };
        assert_eq!(tracker(0.1).lost(), None);
        for sigma in [1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(tracker(sigma).lost(), Some(LostReason::Uncertain(_))), "{sigma}");
        }
    }
}
