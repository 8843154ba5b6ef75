//! Worlds of the Gazebo simulators: an SDF file, its models, their meshes and pictures.
//!
//! | module | idea |
//! | --- | --- |
//! | `sdf` | what stands where, and of what material |
//! | `resolve` | which file a name means |
//! | `mesh`, `shapes` | triangles, from files (COLLADA, OBJ, STL) and of simple shapes |
//! | `paints` | looks |
//! | `assembly` | all of it put together |
//! | `slab`, `floor` | what a robot runs into, and the true plan |
//! | `rearrange` | the world some time later |
//! | `report` | what the files lack |
//!
//! The scanner, the cameras and the bumper all use the *visual* shapes, as Gazebo's rendering
//! sensors do; collision shapes are ignored. Scanner and bumper use everything that lies in one
//! slab of heights, so a robot sees whatever it can hit. Flaws in the files become warnings, and
//! the rest is loaded.

mod assembly;
mod floor;
mod mesh;
mod paints;
mod rearrange;
mod report;
mod resolve;
mod sdf;
mod shapes;
mod slab;

pub use sdf::SdfError;

use crate::plan::FloorPlan;
use crate::scene::{Face, OpenCountry, Scene};
use crate::world::changes::Changes;
use assembly::Assembly;
use fht_perception::pose::Point2;
use floor::FencedFloor;
use report::{Flaw, ImportReport};
use resolve::Paths;
use sdf::GREY;
use std::path::Path;

/// How far the ground is lowered, so that floors at its height are visible, metres.
const SUNK_M: f64 = 0.005;
/// Height of the ground if a world has none, metres: just below the floors.
const DEFAULT_GROUND_M: f64 = -0.1;
/// Height of the fence around an open floor, metres.
const FENCE_M: f64 = 1.5;

/// A world as its files describe it.
pub(crate) struct Gazebo {
    /// `None` if there is nothing to see.
    pub(crate) scene: Option<Scene>,
    /// `None` if there is no room to stand.
    pub(crate) plan: Option<FloorPlan>,
    /// One sentence for each kind of flaw.
    pub(crate) warnings: Vec<String>,
    /// How many models were removed, shifted or added.
    pub(crate) changes: usize,
}

/// Loads a world, with `changes` some time later.
pub(crate) fn load(path: &Path, changes: Option<&Changes>) -> Result<Gazebo, SdfError> {
    let paths = Paths::of_world(path);
    let mut report = ImportReport::default();
    let mut description = sdf::read(path, &paths, &mut report)?;
    if let Some(places) = report.sentence(Flaw::Remote) {
        return Err(SdfError::Remote(places));
    }
    let count = changes.map_or(0, |changes| rearrange::models(&mut description.placed, &paths, changes));
    let mut assembly = Assembly::new(&paths, report);
    for placed in &description.placed {
        assembly.place(placed);
    }
    let Assembly { mut report, mut builder, mut paints, mut outlines, .. } = assembly;
    let floor = floor::find(&outlines, &mut report);
    if let Some(FencedFloor { fence: Some([low, high]), .. }) = &floor {
        let corners = [*low, Point2::new(high.x, low.y), *high, Point2::new(low.x, high.y)];
        let texture = paints.colour(GREY, &mut builder);
        for (index, &from) in corners.iter().enumerate() {
            let to = corners[(index + 1) % corners.len()];
            builder.face(Face { from, to, bottom_m: 0.0, top_m: FENCE_M }, texture, 0.0, FENCE_M);
            outlines.push(vec![from, to]);
        }
    }
    let (ground_m, colour) = description.ground.unwrap_or((DEFAULT_GROUND_M, GREY));
    let ground = paints.colour(colour, &mut builder);
    let sky = description.sky.map(|value| 255.0 * value);
    let scene = builder.build_open(&OpenCountry {
        ground,
        ground_m: ground_m - SUNK_M,
        sky,
        outlines: &outlines,
        slab_m: slab::SLAB_M,
    });
    let warnings = report.sentences();
    let is_lacking = [Flaw::Model, Flaw::ModelFile, Flaw::Mesh].iter().any(|flaw| report.sentence(*flaw).is_some());
    if is_lacking && (scene.is_none() || floor.is_none()) {
        return Err(SdfError::Nothing { flaws: warnings.join("; "), folders: paths.folders() });
    }
    for warning in &warnings {
        tracing::warn!(world = %path.display(), "{warning}");
    }
    Ok(Gazebo { scene, plan: floor.map(|floor| floor.plan), warnings, changes: count })
}
