//! Light in the building and the cameras' response to it. Both differ from run to run.

use parry3d::math::Vector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Steps of the response curve, over 0 to twice white.
const CURVE_STEPS: usize = 1024;

/// The light of one run, drawn from a seed: brightness, colour temperature, direction, and the
/// camera's gain and gamma.
#[derive(Clone, Debug)]
pub(crate) struct Light {
    direction: Vector,
    directional: f32,
    pool_waves: [[f32; 3]; 2],
    curves: [Vec<u8>; 3],
}

impl Light {
    /// Draws the light of a run.
    pub(crate) fn from_seed(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let heading: f32 = rng.random_range(0.0..std::f32::consts::TAU);
        let brightness: f32 = rng.random_range(0.82..1.22);
        let warmth: f32 = rng.random_range(-0.09..0.09);
        let gamma: f32 = rng.random_range(0.86..1.18);
        let gains = [brightness * (1.0 + warmth), brightness, brightness * (1.0 - warmth)];
        let curve = |gain: f32| -> Vec<u8> {
            let value = |step: usize| {
                let level = gain * 2.0 * step as f32 / (CURVE_STEPS - 1) as f32;
                // A soft shoulder: highlights saturate gradually, as in a camera.
                let shouldered = if level > 0.8 { 0.8 + 0.2 * (1.0 - (-(level - 0.8) / 0.2).exp()) } else { level };
                (255.0 * shouldered.powf(gamma)).round() as u8
            };
            (0..CURVE_STEPS).map(value).collect()
        };
        let turn = std::f32::consts::TAU;
        let mut wave = || [rng.random_range(0.25..0.6), rng.random_range(0.25..0.6), rng.random_range(0.0..turn)];
        let pool_waves = [wave(), wave()];
        Self {
            direction: Vector::new(heading.cos(), heading.sin(), 1.2).normalize(),
            directional: rng.random_range(0.10..0.22),
            pool_waves,
            curves: gains.map(curve),
        }
    }

    /// Relative brightness of a face with this normal, about 1.
    pub(crate) fn on_surface(&self, normal: Vector, point: Vector) -> f32 {
        let pools: f32 =
            self.pool_waves.iter().map(|[kx, ky, phase]| (kx * point.x + ky * point.y + phase).sin()).sum();
        0.92 + self.directional * normal.dot(self.direction) + 0.06 * pools
    }

    /// Relative brightness of a wall at a height: darker near the floor and the ceiling.
    pub(crate) fn near_edges(&self, height_m: f32, ceiling_m: f32) -> f32 {
        let low = (height_m / 0.5).min(1.0);
        let high = ((ceiling_m - height_m) / 0.4).min(1.0);
        (0.80 + 0.20 * low) * (0.88 + 0.12 * high)
    }

    /// The pixel that the sensor reports for a colour (0 to 255, more if bright).
    pub(crate) fn respond(&self, colour: [f32; 3]) -> [u8; 3] {
        let channel = |index: usize| {
            let step = (colour[index] * ((CURVE_STEPS - 1) as f32 / 510.0)).clamp(0.0, (CURVE_STEPS - 1) as f32);
            self.curves[index][step as usize]
        };
        [channel(0), channel(1), channel(2)]
    }
}
