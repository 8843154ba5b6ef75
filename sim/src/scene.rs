//! What rays meet: triangles with textures, a floor and a ceiling. One scene serves the LiDAR, the cameras and the bumper.
//!
//! The horizontal floor and ceiling are planes met analytically: no ray can pass them, so they also bound the search in
//! the triangle tree.

use crate::light::Light;
use crate::texture::Texture;
use fht_robot::pose::Point2;
use parry3d::math::Vector;
use parry3d::query::{PointQuery, Ray};
use parry3d::shape::{CompositeShapeRef, TriMesh};

/// Index of a texture of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TextureId(u32);

/// How a flat face maps to its texture: metres to the right and down of the texture's top left corner.
#[derive(Clone, Copy, Debug)]
struct Surface {
    texture: TextureId,
    right: Vector,
    right_offset_m: f32,
    down: Vector,
    down_offset_m: f32,
    normal: Vector,
}

/// What lies under each spot of the floor.
#[derive(Clone, Debug)]
pub(crate) struct Ground {
    /// Min corner, metres.
    pub(crate) origin: Point2,
    /// Side of a cell, metres.
    pub(crate) resolution_m: f64,
    /// Columns.
    pub(crate) width: usize,
    /// Texture of each cell, row by row.
    pub(crate) textures: Vec<TextureId>,
    /// How light each cell is, 0 to 1: corners are dark.
    pub(crate) openness: Vec<f32>,
    /// Texture outside of the cells.
    pub(crate) outside: TextureId,
}

impl Ground {
    fn at(&self, x: f32, y: f32) -> (TextureId, f32) {
        let column = (f64::from(x) - self.origin.x) / self.resolution_m;
        let row = (f64::from(y) - self.origin.y) / self.resolution_m;
        if column < 0.0 || row < 0.0 || column >= self.width as f64 {
            return (self.outside, 1.0);
        }
        let index = row as usize * self.width + column as usize;
        match (self.textures.get(index), self.openness.get(index)) {
            (Some(&texture), Some(&openness)) => (texture, openness),
            _ => (self.outside, 1.0),
        }
    }
}

/// Collects faces.
#[derive(Debug, Default)]
pub(crate) struct SceneBuilder {
    vertices: Vec<Vector>,
    indices: Vec<[u32; 3]>,
    surface_of: Vec<u32>,
    surfaces: Vec<Surface>,
    textures: Vec<Texture>,
}

/// A vertical rectangle over the segment `from` → `to`, seen from the segment's left side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    /// Right end, as seen.
    pub(crate) from: Point2,
    /// Left end, as seen.
    pub(crate) to: Point2,
    /// Lower edge, metres above the floor.
    pub(crate) bottom_m: f64,
    /// Upper edge, metres above the floor.
    pub(crate) top_m: f64,
}

fn spatial(point: Point2, z: f64) -> Vector {
    Vector::new(point.x as f32, point.y as f32, z as f32)
}

impl SceneBuilder {
    /// Adds a texture.
    pub(crate) fn texture(&mut self, texture: Texture) -> TextureId {
        self.textures.push(texture);
        TextureId((self.textures.len() - 1) as u32)
    }

    /// Adds a vertical rectangle. The texture's left edge lies `left_m` to the left of the face's left end, its top edge
    /// at height `texture_top_m`.
    pub(crate) fn face(&mut self, face: Face, texture: TextureId, left_m: f64, texture_top_m: f64) {
        let along = face.from - face.to;
        let length = along.norm();
        if length < 1e-6 || face.top_m - face.bottom_m < 1e-6 {
            return;
        }
        let right = Vector::new((along.x / length) as f32, (along.y / length) as f32, 0.0);
        let left_end = spatial(face.to, 0.0);
        let surface = Surface {
            texture,
            right,
            right_offset_m: left_m as f32 - right.dot(left_end),
            down: Vector::new(0.0, 0.0, -1.0),
            down_offset_m: texture_top_m as f32,
            normal: Vector::new(right.y, -right.x, 0.0),
        };
        let corners = [
            spatial(face.from, face.bottom_m),
            spatial(face.to, face.bottom_m),
            spatial(face.to, face.top_m),
            spatial(face.from, face.top_m),
        ];
        self.polygon(&corners, surface);
    }

    /// Adds a horizontal convex polygon that faces up or down; its texture's top left corner lies at the first corner,
    /// its right edge runs along the first side.
    pub(crate) fn slab(&mut self, corners: &[Point2], height_m: f64, texture: TextureId, faces_up: bool) {
        let [first, second, ..] = corners else { return };
        let side = second - first;
        let length = side.norm().max(1e-9);
        let right = Vector::new((side.x / length) as f32, (side.y / length) as f32, 0.0);
        let down = Vector::new(-right.y, right.x, 0.0);
        let origin = spatial(*first, height_m);
        let surface = Surface {
            texture,
            right,
            right_offset_m: -right.dot(origin),
            down,
            down_offset_m: -down.dot(origin),
            normal: Vector::new(0.0, 0.0, if faces_up { 1.0 } else { -1.0 }),
        };
        let corners: Vec<Vector> = corners.iter().map(|&corner| spatial(corner, height_m)).collect();
        self.polygon(&corners, surface);
    }

    fn polygon(&mut self, corners: &[Vector], surface: Surface) {
        let first = self.vertices.len() as u32;
        self.vertices.extend_from_slice(corners);
        self.surfaces.push(surface);
        for corner in 1..corners.len().saturating_sub(1) as u32 {
            self.indices.push([first, first + corner, first + corner + 1]);
            self.surface_of.push((self.surfaces.len() - 1) as u32);
        }
    }

    /// The scene; `None` without any triangle.
    pub(crate) fn build(self, ground: Ground, ceiling: TextureId, ceiling_m: f64) -> Option<Scene> {
        let mesh = TriMesh::new(self.vertices, self.indices).ok()?;
        Some(Scene {
            mesh,
            surface_of: self.surface_of,
            surfaces: self.surfaces,
            textures: self.textures,
            ground,
            ceiling,
            ceiling_m: ceiling_m as f32,
        })
    }
}

/// Triangles with textures between a floor at height 0 and a ceiling.
#[derive(Clone)]
pub(crate) struct Scene {
    mesh: TriMesh,
    surface_of: Vec<u32>,
    surfaces: Vec<Surface>,
    textures: Vec<Texture>,
    ground: Ground,
    ceiling: TextureId,
    ceiling_m: f32,
}

impl Scene {
    /// Number of triangles.
    pub(crate) fn triangle_count(&self) -> usize {
        self.surface_of.len()
    }

    /// Distance to the first triangle along a ray of unit `direction`, metres, if nearer than `max_m`.
    pub(crate) fn range(&self, origin: Vector, direction: Vector, max_m: f32) -> Option<f32> {
        let ray = Ray::new(origin, direction);
        CompositeShapeRef(&self.mesh).cast_local_ray(&ray, max_m, true).map(|(_, range)| range)
    }

    /// Colour (0 to 255 before the camera's own response) that comes along a ray of unit `direction`; a pixel spans
    /// `pixel_angle` radians.
    pub(crate) fn look(&self, origin: Vector, direction: Vector, pixel_angle: f32, light: &Light) -> [f32; 3] {
        let plane_m = if direction.z < 0.0 {
            -origin.z / direction.z
        } else if direction.z > 0.0 {
            (self.ceiling_m - origin.z) / direction.z
        } else {
            f32::MAX
        };
        let ray = Ray::new(origin, direction);
        if let Some((triangle, range)) = CompositeShapeRef(&self.mesh).cast_local_ray(&ray, plane_m.min(500.0), true) {
            let surface = &self.surfaces[self.surface_of[triangle as usize] as usize];
            let point = origin + direction * range;
            let u = surface.right.dot(point) + surface.right_offset_m;
            let v = surface.down.dot(point) + surface.down_offset_m;
            let slant = surface.normal.dot(direction).abs();
            let colour = self.textures[surface.texture.0 as usize].sample(u, v, footprint(range, pixel_angle, slant));
            let shade = light.on_surface(surface.normal, point) * light.near_edges(point.z, self.ceiling_m);
            return colour.map(|value| value * shade);
        }
        if plane_m > 500.0 {
            return [0.0; 3];
        }
        let point = origin + direction * plane_m;
        let (texture, normal, openness) = if direction.z < 0.0 {
            let (texture, openness) = self.ground.at(point.x, point.y);
            (texture, Vector::new(0.0, 0.0, 1.0), openness)
        } else {
            (self.ceiling, Vector::new(0.0, 0.0, -1.0), 1.0)
        };
        let footprint = footprint(plane_m, pixel_angle, direction.z.abs());
        let colour = self.textures[texture.0 as usize].sample(point.x, -point.y, footprint);
        let shade = light.on_surface(normal, point) * openness;
        colour.map(|value| value * shade)
    }

    /// Nearest point of any triangle to a point `height_m` above the floor, in the plane, and its distance, metres.
    pub(crate) fn nearest(&self, point: Point2, height_m: f64) -> (Point2, f64) {
        let at = spatial(point, height_m);
        let found = self.mesh.project_local_point(at, false).point;
        let nearest = Point2::new(f64::from(found.x), f64::from(found.y));
        (nearest, f64::from(found.distance(at)))
    }
}

/// Size on a surface of what one pixel sees, metres: the mean (geometric) of its short and its long side.
fn footprint(range: f32, pixel_angle: f32, slant: f32) -> f32 {
    range * pixel_angle / slant.max(0.05).sqrt()
}
