//! Wheels: how far they are believed, and what the scans teach about their scale.
//!
//! A wheel's radius and the track are wrong by a constant factor for a whole run. Where walls fix
//! the motion, the factor is learnt (a Kalman filter on each of two numbers); where they do not, as
//! along a bare corridor, it is used.

use fht_perception::pose::{Pose2, pose};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// What the wheels are believed to be.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct OdometryNoise {
    /// Standard deviation of the constant scale errors of distance and of rotation before anything
    /// is learnt. Default 0.03: the wheels of the simulator are off by 0.02.
    pub scale_sigma: f64,
    /// Standard deviation of a distance beyond the scale error, per metre. Default 0.01.
    pub distance_sigma_per_m: f64,
    /// Random walk of the heading, radians per √m. Default 0.0087 (0.5°).
    pub heading_sigma_per_sqrt_m: f64,
    /// Standard deviation of a turn beyond the scale error, per radian. Default 0.01.
    pub turn_sigma_per_rad: f64,
    /// Least standard deviation of a step, metres. Default 0.01.
    pub floor_m: f64,
    /// Least standard deviation of a step, radians. Default 0.01.
    pub floor_rad: f64,
}

impl Default for OdometryNoise {
    fn default() -> Self {
        Self {
            scale_sigma: 0.03,
            distance_sigma_per_m: 0.01,
            heading_sigma_per_sqrt_m: 0.0087,
            turn_sigma_per_rad: 0.01,
            floor_m: 0.01,
            floor_rad: 0.01,
        }
    }
}

/// A factor with its variance.
#[derive(Clone, Copy, Debug)]
struct Scale {
    value: f64,
    variance: f64,
}

impl Scale {
    fn learn(&mut self, measured: f64, variance: f64) {
        // Beyond five sigma it is not the scale: a slip, a bump, a wrong match.
        let innovation = measured - self.value;
        if innovation * innovation > 25.0 * (self.variance + variance) {
            return;
        }
        let gain = self.variance / (self.variance + variance);
        self.value += gain * innovation;
        self.variance *= 1.0 - gain;
    }
}

/// What has been learnt of the wheels of this run.
#[derive(Clone, Debug)]
pub struct OdometryCalibration {
    noise: OdometryNoise,
    distance: Scale,
    turn: Scale,
}

impl OdometryCalibration {
    /// Nothing learnt yet.
    #[must_use]
    pub fn new(noise: OdometryNoise) -> Self {
        let scale = Scale { value: 1.0, variance: noise.scale_sigma * noise.scale_sigma };
        Self { noise, distance: scale, turn: scale }
    }

    /// A motion of the base as the wheels gave it, corrected by what has been learnt.
    #[must_use]
    pub fn correct(&self, raw: &Pose2) -> Pose2 {
        let (distance, turn) = (self.distance.value, self.turn.value);
        pose(raw.translation.x * distance, raw.translation.y * distance, raw.rotation.angle() * turn)
    }

    /// Inverse covariance, in the map frame, of a corrected motion that ends with heading `yaw`.
    #[must_use]
    pub fn information(&self, motion: &Pose2, yaw: f64) -> Matrix3<f64> {
        let noise = &self.noise;
        let (metres, radians) = (motion.translation.vector.norm(), motion.rotation.angle().abs());
        let along = noise.floor_m.hypot(metres * (noise.distance_sigma_per_m.hypot(self.distance.variance.sqrt())));
        let across = noise.floor_m.hypot(0.5 * metres * radians + 0.01 * metres);
        let heading = noise
            .floor_rad
            .hypot(noise.heading_sigma_per_sqrt_m * metres.sqrt())
            .hypot(radians * noise.turn_sigma_per_rad.hypot(self.turn.variance.sqrt()));
        let forward = direction(yaw);
        let mut rotation = Matrix3::identity();
        rotation.fixed_view_mut::<2, 1>(0, 0).copy_from(&forward);
        rotation.fixed_view_mut::<2, 1>(0, 1).copy_from(&nalgebra::Vector2::new(-forward.y, forward.x));
        let diagonal = Vector3::new(along.powi(-2), across.powi(-2), heading.powi(-2));
        rotation * Matrix3::from_diagonal(&diagonal) * rotation.transpose()
    }

    /// Variance of a corrected turn, rad².
    #[must_use]
    pub fn turn_variance(&self, turn_rad: f64) -> f64 {
        turn_rad * turn_rad * (self.noise.turn_sigma_per_rad.powi(2) + self.turn.variance)
    }

    /// The variance of the heading's walk that is taken for granted, rad²/m.
    #[must_use]
    pub fn walk_variance_per_m(&self) -> f64 {
        self.noise.heading_sigma_per_sqrt_m.powi(2)
    }

    /// Learns from a stretch of which both the wheels' and the scans' word are known.
    /// `scan_information` is what the scans alone know of its end (map frame), `yaw` the heading
    /// there.
    pub fn learn(&mut self, raw: &Pose2, matched: &Pose2, scan_information: &Matrix3<f64>, yaw: f64) {
        let forward = direction(yaw);
        let along = Vector3::new(forward.x, forward.y, 0.0);
        let known_along = along.dot(&(scan_information * along));
        let (raw_m, raw_rad) = (raw.translation.vector.norm(), raw.rotation.angle());
        // Both ends are uncertain, and neighbouring matches err alike: twice the variance, and a
        // floor of 3 mm.
        let random = self.noise.distance_sigma_per_m;
        if raw_m > 0.2 && known_along > 0.0 {
            let variance = (2.0 / known_along + 0.003_f64.powi(2)) / (raw_m * raw_m) + random * random;
            self.distance.learn(matched.translation.vector.norm() / raw_m, variance);
        }
        let known_heading = scan_information[(2, 2)];
        if raw_rad.abs() > 0.3 && known_heading > 0.0 {
            let walk = self.noise.heading_sigma_per_sqrt_m.powi(2) * raw_m;
            let variance = (2.0 / known_heading + 0.002_f64.powi(2) + walk) / (raw_rad * raw_rad);
            self.turn.learn(matched.rotation.angle() / raw_rad, variance);
        }
    }
}

/// Unit vector of a heading.
pub(crate) fn direction(yaw: f64) -> Vector2<f64> {
    Vector2::new(yaw.cos(), yaw.sin())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_scale_error_is_learnt_where_walls_fix_the_motion() {
        let mut calibration = OdometryCalibration::new(OdometryNoise::default());
        let sure = Matrix3::from_diagonal_element(1e6);
        for _ in 0..30 {
            calibration.learn(&pose(0.3 * 1.02, 0.0, 0.0), &pose(0.3, 0.0, 0.0), &sure, 0.3);
            calibration.learn(&pose(0.0, 0.0, 0.5 * 0.97), &pose(0.0, 0.0, 0.5), &sure, 0.3);
        }
        let corrected = calibration.correct(&pose(1.02, 0.0, 0.97));
        assert!((corrected.translation.x - 1.0).abs() < 0.003, "{corrected}");
        assert!((corrected.rotation.angle() - 1.0).abs() < 0.005, "{corrected}");
    }

    #[test]
    fn a_corridor_teaches_nothing_about_the_distance() {
        let mut calibration = OdometryCalibration::new(OdometryNoise::default());
        // Across and heading are known, along (x) is not.
        let corridor = Matrix3::from_diagonal(&Vector3::new(1e-3, 1e6, 1e6));
        for _ in 0..30 {
            calibration.learn(&pose(0.3, 0.0, 0.0), &pose(0.2, 0.0, 0.0), &corridor, 0.0);
        }
        let corrected = calibration.correct(&pose(1.0, 0.0, 0.0));
        assert!((corrected.translation.x - 1.0).abs() < 1e-3, "{corrected}");
    }
}
