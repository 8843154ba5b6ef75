//! The ray-cast laser scanner.

use crate::people::body::{self, Body};
use crate::scene::Scene;
use fht_perception::frame::LaserScan;
use fht_perception::pose::{Point2, Pose2, pose};
use nalgebra::Vector2;
use parry3d::math::Vector;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// The laser scanner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LidarConfig {
    /// Beams in a full turn.
    pub(crate) beams: usize,
    /// Shortest range, metres.
    pub(crate) range_min_m: f64,
    /// Longest range, metres.
    pub(crate) range_max_m: f64,
    /// Standard deviation of the range noise, metres.
    pub(crate) noise_m: f64,
    /// Mount on the base: forward, left, up, metres.
    pub(crate) mount_m: [f64; 3],
}

/// What beams meet.
#[derive(Clone, Copy)]
pub(crate) struct Met<'a> {
    /// Walls and things.
    pub(crate) scene: &'a Scene,
    /// Who is there.
    pub(crate) bodies: &'a [Body],
}

/// The scan taken from `world_from_base`. Beams without a return read infinity: the way is free.
/// Beams that end nearer than the shortest range read negative infinity: it is not (REP-117). Each
/// beam draws one number from `noise` whether it returns or not.
pub(crate) fn scan(met: Met<'_>, config: &LidarConfig, world_from_base: &Pose2, noise: &mut impl Rng) -> LaserScan {
    let base_from_sensor = pose(config.mount_m[0], config.mount_m[1], 0.0);
    let world_from_sensor = world_from_base * base_from_sensor;
    let translation = &world_from_sensor.translation;
    let origin = Vector::new(translation.x as f32, translation.y as f32, config.mount_m[2] as f32);
    let place = Point2::from(translation.vector);
    let yaw = world_from_sensor.rotation.angle();
    let angle_increment = std::f64::consts::TAU / config.beams.max(1) as f64;
    let beam = |index: usize| {
        let (sin, cos) = (yaw + index as f64 * angle_increment).sin_cos();
        let error: f64 = StandardNormal.sample(noise);
        let direction = Vector::new(cos as f32, sin as f32, 0.0);
        // Cast a little beyond the range, so that noise can act in both directions at its end.
        let limit = config.range_max_m + 5.0 * config.noise_m;
        let wall_m = met.scene.range(origin, direction, limit as f32).map(f64::from);
        let body_m = body::range(met.bodies, place, Vector2::new(cos, sin), config.mount_m[2]);
        let nearest_m = match (wall_m, body_m.filter(|range| *range < limit)) {
            (Some(wall_m), Some(body_m)) => Some(wall_m.min(body_m)),
            (wall_m, body_m) => wall_m.or(body_m),
        };
        let range = nearest_m.map(|range| range + error * config.noise_m);
        match range {
            Some(range) if range < config.range_min_m => f32::NEG_INFINITY,
            Some(range) if range < config.range_max_m => range as f32,
            _ => f32::INFINITY,
        }
    };
    LaserScan {
        base_from_sensor,
        angle_min: 0.0,
        angle_increment,
        range_min_m: config.range_min_m,
        range_max_m: config.range_max_m,
        ranges_m: (0..config.beams).map(beam).collect(),
    }
}
