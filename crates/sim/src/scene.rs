//! What rays meet: triangles with textures, a floor and a ceiling. One scene serves the LiDAR, the
//! cameras and the bumper.
//!
//! Floor and ceiling are horizontal planes that are intersected analytically. No ray can pass them,
//! so they also bound the search in the triangle tree. In open country there is a sky in place of
//! the ceiling.

pub(crate) mod light;
pub(crate) mod texture;

use fht_perception::pose::Point2;
use light::Light;
use nalgebra::Point3;
use parry3d::math::Vector;
use parry3d::query::{PointQuery, Ray};
use parry3d::shape::{CompositeShapeRef, TriMesh};
use texture::Texture;

/// Triangles with less than this doubled area are left out, square metres.
const LEAST_DOUBLED_AREA_M2: f64 = 1e-12;
/// Sides of obstacles shorter than this are left out, metres.
const LEAST_SIDE_M: f64 = 1e-5;
/// How far sides of obstacles extend beyond their ends, metres.
const OVERLAP_M: f64 = 1e-4;
/// Largest texture coordinate that is used, in units of the texture.
const FARTHEST_UV: f32 = 1e4;

/// Index of a texture of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TextureId(u32);

/// How a flat face maps to its texture: an affine map to units of the texture (metres, or its own
/// widths and heights), right and down from its top left corner. Any mapping of a triangle's
/// corners has this form.
#[derive(Clone, Copy, Debug)]
struct Surface {
    texture: TextureId,
    /// The point that the offsets refer to. It lies near the face, so that steep mappings stay
    /// exact.
    anchor: Vector,
    right: Vector,
    right_offset: f32,
    down: Vector,
    down_offset: f32,
    /// Units of the texture per metre.
    density: f32,
    normal: Vector,
}

/// The texture and shade of each cell of the floor.
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
    /// How bright each cell is, 0 to 1: corners are dark.
    pub(crate) openness: Vec<f32>,
    /// Texture outside the cells.
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

/// Collects the faces of a scene.
#[derive(Debug, Default)]
pub(crate) struct SceneBuilder {
    vertices: Vec<Vector>,
    indices: Vec<[u32; 3]>,
    surface_of: Vec<u32>,
    surfaces: Vec<Surface>,
    textures: Vec<Texture>,
}

/// What surrounds triangles that are not inside a storey.
pub(crate) struct OpenCountry<'a> {
    /// Texture of the ground.
    pub(crate) ground: TextureId,
    /// Height of the ground, metres.
    pub(crate) ground_m: f64,
    /// Colour of the sky, 0 to 255.
    pub(crate) sky: [f32; 3],
    /// What a robot's body can run into, seen from above: lines and convex polygons, metres.
    pub(crate) outlines: &'a [Vec<Point2>],
    /// Lower and upper height of these outlines, metres.
    pub(crate) slab_m: [f64; 2],
}

impl OpenCountry<'_> {
    /// The sides of all outlines, as vertical faces from the bottom to the top of the slab.
    fn obstacles(&self) -> Option<Obstacles> {
        let [bottom_m, top_m] = self.slab_m;
        let mut corners = Vec::new();
        let mut triangles = Vec::new();
        for outline in self.outlines {
            // A line has one side, not one in each direction.
            let sides = if outline.len() == 2 { 1 } else { outline.len() };
            for side in 0..sides {
                let (from, to) = (outline[side], outline[(side + 1) % outline.len()]);
                let length = (to - from).norm();
                if length < LEAST_SIDE_M {
                    continue;
                }
                // So that no ray slips through between two sides.
                let overlap = (to - from) * (OVERLAP_M / length);
                let (from, to) = (from - overlap, to + overlap);
                let first = corners.len() as u32;
                corners.extend([
                    spatial(from, bottom_m),
                    spatial(to, bottom_m),
                    spatial(to, top_m),
                    spatial(from, top_m),
                ]);
                triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        let sides = TriMesh::new(corners, triangles).ok()?;
        Some(Obstacles { sides, bottom_m: bottom_m as f32, top_m: top_m as f32 })
    }
}

/// What a robot can hit and its scanner sees, if that is not simply the triangles.
#[derive(Clone)]
struct Obstacles {
    sides: TriMesh,
    bottom_m: f32,
    top_m: f32,
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

    /// Adds a vertical rectangle. The texture's left edge lies `left_m` (metres) to the left of the
    /// face's left end, its top edge at height `texture_top_m` (metres).
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
            anchor: Vector::ZERO,
            right,
            right_offset: left_m as f32 - right.dot(left_end),
            down: Vector::new(0.0, 0.0, -1.0),
            down_offset: texture_top_m as f32,
            density: 1.0,
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

    /// Adds a horizontal convex polygon that faces up or down. The texture's top left corner lies
    /// at the first corner, and its x axis runs along the first side.
    pub(crate) fn slab(&mut self, corners: &[Point2], height_m: f64, texture: TextureId, faces_up: bool) {
        let [first, second, ..] = corners else { return };
        let side = second - first;
        let length = side.norm().max(1e-9);
        let right = Vector::new((side.x / length) as f32, (side.y / length) as f32, 0.0);
        let down = Vector::new(-right.y, right.x, 0.0);
        let origin = spatial(*first, height_m);
        let surface = Surface {
            texture,
            anchor: Vector::ZERO,
            right,
            right_offset: -right.dot(origin),
            down,
            down_offset: -down.dot(origin),
            density: 1.0,
            normal: Vector::new(0.0, 0.0, if faces_up { 1.0 } else { -1.0 }),
        };
        let corners: Vec<Vector> = corners.iter().map(|&corner| spatial(corner, height_m)).collect();
        self.polygon(&corners, surface);
    }

    /// Adds a triangle, seen from both sides. `uv` are its corners in the texture: right and down
    /// from the top left corner, in units of the texture. A triangle without area is left out.
    pub(crate) fn triangle(&mut self, corners: [Point3<f64>; 3], uv: [[f32; 2]; 3], texture: TextureId) {
        let [a, b, c] = corners;
        let (along, across) = (b - a, c - a);
        let normal = along.cross(&across);
        let doubled_area = normal.norm();
        if doubled_area < LEAST_DOUBLED_AREA_M2 {
            return;
        }
        // The texture repeats, so whole units can be dropped, and small numbers are exact.
        let whole = uv[0].map(f32::floor);
        let is_sound = uv.iter().flatten().all(|value| value.abs() <= FARTHEST_UV);
        let place = |corner: usize, axis: usize| if is_sound { f64::from(uv[corner][axis] - whole[axis]) } else { 0.0 };
        let gradient = |axis: usize| {
            let (by_along, by_across) = (place(1, axis) - place(0, axis), place(2, axis) - place(0, axis));
            let squared = doubled_area * doubled_area;
            (across.cross(&normal) * by_along + normal.cross(&along) * by_across) / squared
        };
        let (right, down) = (gradient(0), gradient(1));
        let single = |vector: nalgebra::Vector3<f64>| Vector::new(vector.x as f32, vector.y as f32, vector.z as f32);
        let surface = Surface {
            texture,
            anchor: single(a.coords),
            right: single(right),
            right_offset: place(0, 0) as f32,
            down: single(down),
            down_offset: place(0, 1) as f32,
            density: ((right.norm() + down.norm()) / 2.0) as f32,
            normal: single(normal / doubled_area),
        };
        self.polygon(&corners.map(|corner| single(corner.coords)), surface);
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

    /// The scene of a storey; `None` without any triangle.
    pub(crate) fn build(self, ground: Ground, ceiling: TextureId, ceiling_m: f64) -> Option<Scene> {
        let mesh = TriMesh::new(self.vertices, self.indices).ok()?;
        Some(Scene {
            mesh,
            obstacles: None,
            surface_of: self.surface_of,
            surfaces: self.surfaces,
            textures: self.textures,
            ground,
            ground_m: 0.0,
            ceiling,
            ceiling_m: ceiling_m as f32,
            sky: [0.0; 3],
        })
    }

    /// The scene of open country; `None` without any triangle.
    pub(crate) fn build_open(self, country: &OpenCountry<'_>) -> Option<Scene> {
        let ground = Ground {
            origin: Point2::origin(),
            resolution_m: 1.0,
            width: 0,
            textures: Vec::new(),
            openness: Vec::new(),
            outside: country.ground,
        };
        let scene = self.build(ground, country.ground, f64::INFINITY)?;
        Some(Scene { obstacles: country.obstacles(), ground_m: country.ground_m as f32, sky: country.sky, ..scene })
    }
}

/// Triangles with textures between a floor and a ceiling or the sky.
#[derive(Clone)]
pub(crate) struct Scene {
    mesh: TriMesh,
    obstacles: Option<Obstacles>,
    surface_of: Vec<u32>,
    surfaces: Vec<Surface>,
    textures: Vec<Texture>,
    ground: Ground,
    ground_m: f32,
    ceiling: TextureId,
    /// Infinite in open country.
    ceiling_m: f32,
    sky: [f32; 3],
}

impl Scene {
    /// Number of triangles.
    pub(crate) fn triangle_count(&self) -> usize {
        self.surface_of.len()
    }

    /// Distance to the first hit of a level ray of unit `direction`, metres, if it is nearer than
    /// `max_m`. What is hit is a triangle; in open country, at heights where it has obstacles, one
    /// of these.
    pub(crate) fn range(&self, origin: Vector, direction: Vector, max_m: f32) -> Option<f32> {
        let ray = Ray::new(origin, direction);
        let met = match &self.obstacles {
            Some(obstacles) if (obstacles.bottom_m..=obstacles.top_m).contains(&origin.z) => &obstacles.sides,
            _ => &self.mesh,
        };
        CompositeShapeRef(met).cast_local_ray(&ray, max_m, true).map(|(_, range)| range)
    }

    /// Colour seen along a ray of unit `direction`, 0 to 255 before the camera's response. A pixel
    /// spans `pixel_angle` radians. `body` is what stands before the scene: its distance, metres,
    /// and its colour.
    pub(crate) fn colour_along(
        &self,
        origin: Vector,
        direction: Vector,
        pixel_angle: f32,
        light: &Light,
        body: Option<(f32, [f32; 3])>,
    ) -> [f32; 3] {
        let plane_m = if direction.z < 0.0 {
            (self.ground_m - origin.z) / direction.z
        } else if direction.z > 0.0 {
            (self.ceiling_m - origin.z) / direction.z
        } else {
            f32::MAX
        };
        let ray = Ray::new(origin, direction);
        if let Some((body_m, colour)) = body.filter(|(body_m, _)| *body_m < plane_m) {
            let is_hidden = CompositeShapeRef(&self.mesh).cast_local_ray(&ray, body_m, true).is_some();
            if !is_hidden {
                let shade = light.on_surface(-direction, origin + direction * body_m);
                return colour.map(|value| value * shade);
            }
        }
        if let Some((triangle, range)) = CompositeShapeRef(&self.mesh).cast_local_ray(&ray, plane_m.min(500.0), true) {
            let surface = &self.surfaces[self.surface_of[triangle as usize] as usize];
            let point = origin + direction * range;
            let from_anchor = point - surface.anchor;
            let u = surface.right.dot(from_anchor) + surface.right_offset;
            let v = surface.down.dot(from_anchor) + surface.down_offset;
            let facing = surface.normal.dot(direction);
            let footprint = footprint(range, pixel_angle, facing.abs()) * surface.density;
            let colour = self.textures[surface.texture.0 as usize].sample(u, v, footprint);
            // The visible side is the one that is lit.
            let normal = if facing > 0.0 { -surface.normal } else { surface.normal };
            // In open country edges are as bright as the rest.
            let edges = if self.ceiling_m.is_finite() { light.near_edges(point.z, self.ceiling_m) } else { 1.0 };
            let shade = light.on_surface(normal, point) * edges;
            return colour.map(|value| value * shade);
        }
        if plane_m > 500.0 {
            return self.sky;
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

    /// The point nearest to `point`, at `height_m` above the floor, of anything that a body can
    /// hit, and its distance, metres. In open country that is an obstacle, else any triangle.
    pub(crate) fn nearest(&self, point: Point2, height_m: f64) -> (Point2, f64) {
        let (met, height_m) = match &self.obstacles {
            Some(obstacles) => (&obstacles.sides, f64::from((obstacles.bottom_m + obstacles.top_m) / 2.0)),
            None => (&self.mesh, height_m),
        };
        let at = spatial(point, height_m);
        let found = met.project_local_point(at, false).point;
        let nearest = Point2::new(f64::from(found.x), f64::from(found.y));
        (nearest, f64::from(found.distance(at)))
    }
}

/// Size of a pixel's footprint on a surface, metres: the geometric mean of its short and its long
/// side.
fn footprint(range: f32, pixel_angle: f32, slant: f32) -> f32 {
    range * pixel_angle / slant.max(0.05).sqrt()
}
