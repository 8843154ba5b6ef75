//! Where robots start.

use crate::simulator::SimConfig;
use crate::world::World;
use fht_perception::pose::{Point2, Pose2, pose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// Clearance around a place where an explorer starts, metres.
const CLEARANCE_M: f64 = 0.3;
/// Explorers start at least this far apart, metres.
const LEAST_APART_M: f64 = 0.8;

/// A start pose for another explorer: in sight of `from`, at most `reach_m` (metres) away, with a
/// random heading. Anywhere in the building if `reach_m` is infinite.
#[must_use]
pub fn start_near(world: &World, from: &Pose2, reach_m: f64, seed: u64) -> Pose2 {
    if reach_m.is_infinite() {
        return world.random_free_pose(seed, CLEARANCE_M);
    }
    let here = Point2::from(from.translation.vector);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || {
        let (bearing, apart_m) = (rng.random_range(-PI..PI), rng.random_range(LEAST_APART_M.min(reach_m)..=reach_m));
        pose(here.x + apart_m * bearing.cos(), here.y + apart_m * bearing.sin(), rng.random_range(-PI..PI))
    };
    let is_free = |place: &Pose2| {
        let there = Point2::from(place.translation.vector);
        world.plan().clearance_m(there) >= CLEARANCE_M && world.is_clear(here, there, SimConfig::default().radius_m)
    };
    (0..10_000).map(|_| draw()).find(is_free).unwrap_or(*from)
}
