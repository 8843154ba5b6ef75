//! A world: what rays meet, and the true plan.

use crate::draw::surfaces::Ceiling;
use crate::layout::Layout;
use crate::plan::FloorPlan;
use crate::scene::Scene;
use crate::style::Style;
use crate::{dress, museum, office};
use fht_robot::pose::{Point2, Pose2, pose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};

/// A world cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// No built-in world has this name, and it is no path to a map.
    #[error("unknown world '{0}': expected museum, office, or the path of a Nav2 map.yaml")]
    Unknown(String),
    /// The world has no wall or no place to stand.
    #[error("world '{0}' has no {1}")]
    Empty(String, &'static str),
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

/// Triangles with textures, and the true floor plan. Shared, read-only, by any number of simulators.
pub struct World {
    name: String,
    scene: Scene,
    plan: FloorPlan,
    start: Pose2,
}

/// Clearance at a default start, metres, for the search in worlds whose start is not drawn.
const REACH_RADIUS_M: f64 = 0.2;

impl World {
    /// Name: `museum`, `office`, or a map's file stem.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The true floor plan, for scoring only.
    #[must_use]
    pub fn plan(&self) -> &FloorPlan {
        &self.plan
    }

    /// Default start of an explorer, world frame, well clear of walls.
    #[must_use]
    pub fn start(&self) -> Pose2 {
        self.start
    }

    /// A pose drawn uniformly from the free places with at least `clearance_m` (metres) around them that can be reached
    /// from [`start`](Self::start), heading anywhere. The start itself if there is no such place.
    #[must_use]
    pub fn random_free_pose(&self, seed: u64, clearance_m: f64) -> Pose2 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let from = Point2::from(self.start.translation.vector);
        let reachable = self.plan.reachable(from, REACH_RADIUS_M.min(clearance_m));
        let width = self.plan.width();
        let roomy = |index: &usize| {
            reachable.cells()[*index]
                && self.plan.clearance_m(self.plan.centre_of(index % width, index / width)) >= clearance_m
        };
        let places: Vec<usize> = (0..reachable.cells().len()).filter(roomy).collect();
        let yaw = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
        if places.is_empty() {
            return self.start;
        }
        let index = places[rng.random_range(0..places.len())];
        let centre = self.plan.centre_of(index % width, index / width);
        pose(centre.x, centre.y, yaw)
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.scene.triangle_count()
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    fn from_layout(name: &str, layout: &Layout<Style>, ceiling: Ceiling, seed: u64) -> Result<Self, WorldError> {
        let plan = layout.plan();
        let scene =
            dress::dress(layout, &plan, ceiling, seed).ok_or_else(|| WorldError::Empty(name.to_owned(), "walls"))?;
        Ok(Self { name: name.to_owned(), scene, plan, start: Pose2::identity() })
    }
}

/// Loads a world: `museum` or `office`, built in and drawn from `seed`, or the path of a Nav2 map.yaml, its walls painted
/// by `seed` with pictures of the folder `textures`, or with own drawings without one.
///
/// # Errors
/// When the name is unknown, or a file is missing, malformed or shows no free place.
pub fn load(spec: &str, textures: Option<&Path>, seed: u64) -> Result<World, WorldError> {
    let _ = textures;
    match spec {
        "museum" => World::from_layout(spec, &museum::layout(seed), Ceiling::Gallery, seed),
        "office" => World::from_layout(spec, &office::layout(seed), Ceiling::Grid, seed),
        other => Err(WorldError::Unknown(other.to_owned())),
    }
}
