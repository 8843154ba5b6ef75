//! Worlds of the Gazebo simulators: an SDF file, its models, their meshes and pictures.
//!
//! | module | idea |
//! | --- | --- |
//! | `sdf` | what stands where |
//! | `resolve` | which file a name means |
//! | `mesh`, `collada`, `obj`, `stl`, `shapes` | triangles |
//! | `material`, `paints` | looks |
//! | `slab`, `floor` | what a robot runs into, and the true plan |
//! | `rearrange` | the world some time later |
//! | `report` | what the files lack |
//!
//! The scanner, the cameras and the bumper all meet the *visual* shapes, as Gazebo's own scanners do that render; its
//! collision shapes are left aside. Scanner and bumper meet all that lies in one slab, so that a robot sees whatever it can
//! run into. Flaws of the files are told as warnings, and the rest is loaded.

mod collada;
mod floor;
mod material;
mod mesh;
mod obj;
mod paints;
mod rearrange;
mod report;
mod resolve;
mod sdf;
mod shapes;
mod slab;
mod stl;

pub use sdf::SdfError;

use crate::changes::Changes;
use crate::plan::FloorPlan;
use crate::scene::{Face, OpenCountry, Scene, SceneBuilder};
use fht_robot::pose::Point2;
use floor::Floor;
use material::GREY;
use mesh::{Corner, Mesh, Paint, Part};
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Vector3};
use paints::Paints;
use report::{Flaw, Report};
use resolve::Paths;
use sdf::{Placed, Shape};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most triangles of a world.
const MOST_TRIANGLES: usize = 16_000_000;
/// Farthest place of a corner, metres.
const FARTHEST_M: f64 = 1e5;
/// How far the ground is sunk, so that floors at its height are seen, metres.
const SUNK_M: f64 = 0.005;
/// Height of the ground where a world has none, metres: just below the floors.
const DEFAULT_GROUND_M: f64 = -0.1;
/// Height of the fence around an open floor, metres.
const FENCE_M: f64 = 1.5;

/// A world as its files have it.
pub(crate) struct Gazebo {
    /// `None` if there is nothing to be seen.
    pub(crate) scene: Option<Scene>,
    /// `None` if there is no room to stand.
    pub(crate) plan: Option<FloorPlan>,
    /// A sentence for each sort of flaw.
    pub(crate) warnings: Vec<String>,
    /// Models that are gone, shifted or new.
    pub(crate) changes: usize,
}

/// Loads a world, some time later if there are `changes`.
pub(crate) fn load(path: &Path, changes: Option<&Changes>) -> Result<Gazebo, SdfError> {
    let paths = Paths::of_world(path);
    let mut report = Report::default();
    let mut description = sdf::read(path, &paths, &mut report)?;
    let count = changes.map_or(0, |changes| rearrange::models(&mut description.placed, &paths, changes));
    let mut assembly = Assembly::new(&paths, report);
    for placed in &description.placed {
        assembly.place(placed);
    }
    let Assembly { mut report, mut builder, mut paints, mut outlines, .. } = assembly;
    let floor = floor::find(&outlines, &mut report);
    if let Some(Floor { fence: Some([low, high]), .. }) = &floor {
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
    for warning in &warnings {
        tracing::warn!(world = %path.display(), "{warning}");
    }
    Ok(Gazebo { scene, plan: floor.map(|floor| floor.plan), warnings, changes: count })
}

/// A scene being put together.
struct Assembly<'a> {
    paths: &'a Paths,
    report: Report,
    builder: SceneBuilder,
    paints: Paints,
    meshes: HashMap<PathBuf, Option<Arc<Mesh>>>,
    /// What a robot can run into and its scanner sees, from above.
    outlines: Vec<Vec<Point2>>,
    triangles: usize,
}

impl<'a> Assembly<'a> {
    fn new(paths: &'a Paths, report: Report) -> Self {
        Self {
            paths,
            report,
            builder: SceneBuilder::default(),
            paints: Paints::default(),
            meshes: HashMap::new(),
            outlines: Vec::new(),
            triangles: 0,
        }
    }

    fn place(&mut self, placed: &Placed) {
        let base = &placed.base;
        let world_from = &placed.world_from_visual;
        let grey = Paint { colour: GREY, picture: None };
        let paint = placed.paint.as_ref();
        let simple = match &placed.shape {
            Shape::Mesh { uri, scale, part } => {
                let Some(path) = self.paths.find(uri, base).filter(|path| path.is_file()) else {
                    self.report.note(Flaw::Mesh, format!("{uri} (missing)"));
                    return;
                };
                let Some(mesh) = self.mesh(&path, uri) else { return };
                let folder = path.parent().unwrap_or(base);
                let is_chosen = |own: &&Part| part.as_ref().is_none_or(|(name, _)| own.names.contains(name));
                let chosen: Vec<&Part> = mesh.parts.iter().filter(is_chosen).collect();
                if chosen.is_empty() && !mesh.parts.is_empty() {
                    self.report.note(Flaw::Mesh, format!("{uri} (no such part)"));
                }
                let offset = match part {
                    Some((_, true)) => centre(&chosen),
                    _ => Vector3::zeros(),
                };
                let to_world = |position: Vector3<f64>| {
                    world_from * Point3::from((position - offset).component_mul(&Vector3::from(*scale)))
                };
                for own in chosen {
                    let (paint, folder) = match (paint, &own.paint) {
                        (Some(paint), _) => (paint, &**base),
                        (None, Some(paint)) => (paint, folder),
                        (None, None) => (&grey, folder),
                    };
                    self.draw(&own.triangles, paint, folder, to_world, uri);
                }
                return;
            }
            Shape::Box(size) => shapes::cuboid(*size),
            Shape::Cylinder { radius, length } => shapes::cylinder(*radius, *length),
            Shape::Ellipsoid(radii) => shapes::ellipsoid(*radii),
            Shape::Capsule { radius, length } => shapes::capsule(*radius, *length),
            Shape::Plane { normal, size } => {
                let up = Rotation3::rotation_between(&Vector3::z(), normal)
                    .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
                let turned: Isometry3<f64> = world_from * Isometry3::from_parts(Translation3::identity(), up.into());
                let to_world = |position: Vector3<f64>| turned * Point3::from(position);
                self.draw(&shapes::plane(*size), paint.unwrap_or(&grey), base, to_world, "plane");
                return;
            }
            Shape::Polyline { outline, height } => shapes::extrusion(outline, *height),
        };
        let to_world = |position: Vector3<f64>| world_from * Point3::from(position);
        self.draw(&simple, paint.unwrap_or(&grey), base, to_world, "shape");
    }

    fn mesh(&mut self, path: &Path, uri: &str) -> Option<Arc<Mesh>> {
        if let Some(mesh) = self.meshes.get(path) {
            return mesh.clone();
        }
        let mesh = match mesh::load(path) {
            Ok(mesh) => {
                if mesh.malformed > 0 {
                    self.report.note(Flaw::Triangles, format!("{uri} ({} of them)", mesh.malformed));
                }
                Some(Arc::new(mesh))
            }
            Err(error) => {
                self.report.note(Flaw::Mesh, format!("{uri} ({error})"));
                None
            }
        };
        self.meshes.insert(path.to_owned(), mesh.clone());
        mesh
    }

    fn draw(
        &mut self,
        triangles: &[[Corner; 3]],
        paint: &Paint,
        folder: &Path,
        to_world: impl Fn(Vector3<f64>) -> Point3<f64>,
        name: &str,
    ) {
        self.triangles += triangles.len();
        if self.triangles > MOST_TRIANGLES {
            self.report.note(Flaw::Extent, format!("{name}, after the first {MOST_TRIANGLES} triangles"));
            self.triangles -= triangles.len();
            return;
        }
        let texture = self.paints.texture(paint, folder, self.paths, &mut self.builder, &mut self.report);
        let mut malformed = false;
        for triangle in triangles {
            let corners = triangle.map(|corner| to_world(corner.position.into()));
            let is_near = |corner: &Point3<f64>| corner.iter().all(|value| value.abs() <= FARTHEST_M);
            if !corners.iter().all(is_near) {
                malformed = true;
                continue;
            }
            // Pictures are read from their upper left corner.
            self.builder.triangle(corners, triangle.map(|corner| [corner.uv[0], 1.0 - corner.uv[1]]), texture);
            self.outlines.extend(slab::outline(&corners));
        }
        if malformed {
            self.report.note(Flaw::Triangles, format!("{name} (too far out)"));
        }
    }
}

/// Middle of the extent of some parts.
fn centre(parts: &[&Part]) -> Vector3<f64> {
    let corners = || parts.iter().flat_map(|part| part.triangles.as_flattened()).map(|corner| corner.position.into());
    let Some(first) = corners().next() else { return Vector3::zeros() };
    let (low, high) =
        corners().fold((first, first), |(low, high): (Vector3<f64>, _), corner| (low.inf(&corner), high.sup(&corner)));
    (low + high) / 2.0
}
