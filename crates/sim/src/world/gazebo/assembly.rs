//! Visuals put together: triangles with paint for the cameras, outlines for scanner and bumper.

use super::mesh::{MeshCorner, Paint, Part, TriangleMesh, file};
use super::paints::Paints;
use super::report::{Flaw, ImportReport};
use super::resolve::Paths;
use super::sdf::{GREY, Placed, Shape};
use super::{shapes, slab};
use crate::scene::SceneBuilder;
use fht_perception::pose::Point2;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, Vector3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Most triangles of a world.
const MOST_TRIANGLES: usize = 16_000_000;
/// Largest coordinate of a corner, metres.
const FARTHEST_M: f64 = 1e5;

/// A scene being put together.
pub(crate) struct Assembly<'a> {
    paths: &'a Paths,
    pub(crate) report: ImportReport,
    pub(crate) builder: SceneBuilder,
    pub(crate) paints: Paints,
    meshes: HashMap<PathBuf, Option<Arc<TriangleMesh>>>,
    /// What a robot can hit and its scanner sees, from above.
    pub(crate) outlines: Vec<Vec<Point2>>,
    triangles: usize,
}

impl<'a> Assembly<'a> {
    /// An empty assembly.
    pub(crate) fn new(paths: &'a Paths, report: ImportReport) -> Self {
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

    /// Adds a visual: its triangles to the scene, its outlines to what a robot can hit.
    pub(crate) fn place(&mut self, placed: &Placed) {
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

    fn mesh(&mut self, path: &Path, uri: &str) -> Option<Arc<TriangleMesh>> {
        if let Some(mesh) = self.meshes.get(path) {
            return mesh.clone();
        }
        let mesh = match file::load(path) {
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
        triangles: &[[MeshCorner; 3]],
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
            // Textures count from their upper left corner.
            self.builder.triangle(corners, triangle.map(|corner| [corner.uv[0], 1.0 - corner.uv[1]]), texture);
            self.outlines.extend(slab::outline(&corners));
        }
        if malformed {
            self.report.note(Flaw::Triangles, format!("{name} (too far out)"));
        }
    }
}

/// Centre of the bounding box of some parts.
fn centre(parts: &[&Part]) -> Vector3<f64> {
    let corners = || parts.iter().flat_map(|part| part.triangles.as_flattened()).map(|corner| corner.position.into());
    let Some(first) = corners().next() else { return Vector3::zeros() };
    let (low, high) =
        corners().fold((first, first), |(low, high): (Vector3<f64>, _), corner| (low.inf(&corner), high.sup(&corner)));
    (low + high) / 2.0
}
