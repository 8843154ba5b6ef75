//! Four cameras of 90° that share one centre, so that their views join without a seam.

use crate::people::body::{self, Body};
use crate::scene::Scene;
use crate::scene::light::Light;
use fht_perception::frame::Panorama;
use fht_perception::pose::Pose2;
use image::RgbImage;
use parry3d::math::Vector;
use rand::Rng;

/// The cameras.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraConfig {
    /// Height of the common centre above the floor, metres. It lies over the base's origin.
    pub(crate) height_m: f64,
    /// Side of a view, pixels.
    pub(crate) pixels: u32,
    /// Standard deviation of the pixel noise, grey levels of 255.
    pub(crate) noise_levels: f32,
}

/// What the cameras look at.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    /// Walls and things.
    pub(crate) scene: &'a Scene,
    /// Who is there.
    pub(crate) bodies: &'a [Body],
    /// The light that day.
    pub(crate) light: &'a Light,
}

/// Renders the panorama seen from `world_from_base`. The pixel noise comes from `noise`.
pub(crate) fn panorama(
    seen: Seen<'_>,
    config: &CameraConfig,
    world_from_base: &Pose2,
    noise: &mut impl Rng,
) -> Panorama {
    let translation = &world_from_base.translation;
    let centre = Vector::new(translation.x as f32, translation.y as f32, config.height_m as f32);
    let yaw = world_from_base.rotation.angle();
    let views = [0.0, 0.25, 0.5, 0.75].map(|turn| {
        let heading = yaw + turn * std::f64::consts::TAU;
        view(seen, config, centre, heading, noise)
    });
    Panorama { views }
}

fn view(seen: Seen<'_>, config: &CameraConfig, centre: Vector, heading: f64, noise: &mut impl Rng) -> RgbImage {
    let light = seen.light;
    let side = config.pixels;
    let (sin, cos) = (heading.sin() as f32, heading.cos() as f32);
    let ahead = Vector::new(cos, sin, 0.0);
    let right = Vector::new(sin, -cos, 0.0);
    let up = Vector::new(0.0, 0.0, 1.0);
    // 90° across: the picture plane at distance 1 spans -1 to 1.
    let step = 2.0 / side as f32;
    let mut bytes = Vec::with_capacity((side * side * 3) as usize);
    let mut noise_bytes = vec![0_u8; (side * 6) as usize];
    for row in 0..side {
        noise.fill_bytes(&mut noise_bytes);
        let y = 1.0 - (row as f32 + 0.5) * step;
        for column in 0..side {
            let x = (column as f32 + 0.5) * step - 1.0;
            let scale = 1.0 / (1.0 + x * x + y * y).sqrt();
            let direction = (ahead + right * x + up * y) * scale;
            let body = body::seen(seen.bodies, centre, direction);
            let colour = seen.scene.colour_along(centre, direction, step * scale, light, body);
            // A lens passes less light towards its corners; equal on both sides of a seam.
            let vignetting = 0.94 + 0.06 * scale * scale;
            let pixel = light.respond(colour.map(|value| value * vignetting));
            let random = &noise_bytes[column as usize * 6..column as usize * 6 + 6];
            for (channel, value) in pixel.into_iter().enumerate() {
                // The sum of two uniform bytes has standard deviation 104.5, and is close enough to
                // a normal distribution.
                let sum = f32::from(random[2 * channel]) + f32::from(random[2 * channel + 1]) - 255.0;
                bytes.push((f32::from(value) + sum * (config.noise_levels / 104.5) + 0.5) as u8);
            }
        }
    }
    RgbImage::from_raw(side, side, bytes).unwrap_or_default()
}
