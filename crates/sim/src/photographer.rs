//! Panoramas rendered one by one, without a robot that drives: only some pictures of a recorded
//! drive are ever used.

use crate::people::Body;
use crate::scene::light::Light;
use crate::sensing::camera::{self, CameraConfig};
use crate::simulator::SimConfig;
use crate::world::World;
use fht_perception::frame::Panorama;
use fht_perception::pose::Pose2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// The cameras of one robot on one day. The same world, config, seed, pose and number give the same
/// picture, bit for bit.
pub struct Photographer {
    world: Arc<World>,
    config: CameraConfig,
    light: Light,
    seed: u64,
}

impl Photographer {
    /// Cameras and light as in `config`; `seed` is the seed of the pixel noise.
    #[must_use]
    pub fn new(world: Arc<World>, config: &SimConfig, seed: u64) -> Self {
        Self { world, config: config.camera(), light: Light::from_seed(config.light_seed), seed }
    }

    /// The panorama seen from `world_from_base`, with `people` in it. `number` is its number in the
    /// drive; each number has its own pixel noise.
    #[must_use]
    pub fn panorama(&self, world_from_base: &Pose2, people: &[Body], number: u64) -> Panorama {
        let mut noise = ChaCha8Rng::seed_from_u64(self.seed);
        noise.set_stream(number);
        let seen = camera::Seen { scene: self.world.scene(), bodies: people, light: &self.light };
        camera::panorama(seen, &self.config, world_from_base, &mut noise)
    }
}
