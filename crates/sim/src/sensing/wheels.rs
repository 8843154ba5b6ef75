//! Wheel odometry that drifts.

use fht_perception::pose::{Pose2, pose};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// The errors of wheel odometry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WheelConfig {
    /// Standard deviation of the run's scale error in distance, a fraction.
    pub(crate) distance_scale_sigma: f64,
    /// Standard deviation of the run's scale error in rotation, a fraction.
    pub(crate) rotation_scale_sigma: f64,
    /// Standard deviation of the heading after one metre, radians; it grows with the root of the
    /// distance.
    pub(crate) heading_walk_rad_per_sqrt_m: f64,
}

/// The odometer.
#[derive(Clone, Debug)]
pub(crate) struct Wheels {
    odom_from_base: Pose2,
    distance_scale: f64,
    rotation_scale: f64,
    heading_walk_rad_per_sqrt_m: f64,
}

impl Wheels {
    /// An odometer at the identity; the run's scale errors are drawn here.
    pub(crate) fn new(config: &WheelConfig, rng: &mut impl Rng) -> Self {
        let distance: f64 = StandardNormal.sample(rng);
        let rotation: f64 = StandardNormal.sample(rng);
        Self {
            odom_from_base: Pose2::identity(),
            distance_scale: 1.0 + config.distance_scale_sigma * distance,
            rotation_scale: 1.0 + config.rotation_scale_sigma * rotation,
            heading_walk_rad_per_sqrt_m: config.heading_walk_rad_per_sqrt_m,
        }
    }

    /// Where the base is according to the wheels: x, y and heading in double precision, which is
    /// all that an odometry message can carry. So a recorded run replays bit for bit.
    pub(crate) fn odom_from_base(&self) -> Pose2 {
        let at = self.odom_from_base.translation;
        pose(at.x, at.y, self.odom_from_base.rotation.angle())
    }

    /// Adds a small motion: metres forward along the base's x, radians of turn. The step is taken
    /// along the arc's middle heading.
    pub(crate) fn roll(&mut self, forward_m: f64, turn_rad: f64, rng: &mut impl Rng) {
        let random: f64 = StandardNormal.sample(rng);
        let walk = self.heading_walk_rad_per_sqrt_m * forward_m.abs().sqrt() * random;
        let turn = turn_rad * self.rotation_scale + walk;
        let forward = forward_m * self.distance_scale;
        self.odom_from_base *= pose(0.0, 0.0, turn / 2.0) * pose(forward, 0.0, 0.0) * pose(0.0, 0.0, turn / 2.0);
        // Over hours, a product of rotations would lose its unit length.
        self.odom_from_base.rotation.renormalize();
    }
}
