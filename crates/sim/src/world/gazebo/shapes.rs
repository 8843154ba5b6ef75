//! The simple shapes of SDF as triangles. A picture covers each face of a box once, and goes once
//! around round shapes.

use super::mesh::MeshCorner;
use nalgebra::{Point2, Vector2};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Sides of a round shape: at a radius of half a metre they deviate from the circle by 3 mm.
const SIDES: usize = 32;
/// Rows from pole to pole of a sphere.
const ROWS: usize = 16;

/// A triangle in the shape's frame, metres.
type Triangle = [MeshCorner; 3];

fn corner(position: [f64; 3], u: f64, v: f64) -> MeshCorner {
    MeshCorner { position, uv: [u as f32, v as f32] }
}

/// The two triangles of a rectangle that spans `right` and `up` from `corner`, where the picture's
/// lower left corner lies.
fn rectangle(at: [f64; 3], right: [f64; 3], up: [f64; 3]) -> [Triangle; 2] {
    let place = |u: f64, v: f64| corner(std::array::from_fn(|axis| at[axis] + u * right[axis] + v * up[axis]), u, v);
    let (a, b, c, d) = (place(0.0, 0.0), place(1.0, 0.0), place(1.0, 1.0), place(0.0, 1.0));
    [[a, b, c], [a, c, d]]
}

/// A box around the origin, its sizes along x, y and z.
pub(crate) fn cuboid([x, y, z]: [f64; 3]) -> Vec<Triangle> {
    let (hx, hy, hz) = (x / 2.0, y / 2.0, z / 2.0);
    let up = [0.0, 0.0, z];
    [
        rectangle([hx, -hy, -hz], [0.0, y, 0.0], up),
        rectangle([-hx, hy, -hz], [0.0, -y, 0.0], up),
        rectangle([hx, hy, -hz], [-x, 0.0, 0.0], up),
        rectangle([-hx, -hy, -hz], [x, 0.0, 0.0], up),
        rectangle([-hx, -hy, hz], [x, 0.0, 0.0], [0.0, y, 0.0]),
        rectangle([-hx, hy, -hz], [x, 0.0, 0.0], [0.0, -y, 0.0]),
    ]
    .concat()
}

/// A rectangle in the plane x, y around the origin, seen from above.
pub(crate) fn plane([x, y]: [f64; 2]) -> Vec<Triangle> {
    rectangle([-x / 2.0, -y / 2.0, 0.0], [x, 0.0, 0.0], [0.0, y, 0.0]).to_vec()
}

/// A cylinder along z around the origin.
pub(crate) fn cylinder(radius: f64, length: f64) -> Vec<Triangle> {
    let rim: Vec<Point2<f64>> = (0..SIDES).map(|side| circle(side, radius)).collect();
    let mut triangles = prism(&rim, -length / 2.0, length / 2.0);
    for side in 0..SIDES {
        let (a, b) = (rim[side], rim[(side + 1) % SIDES]);
        for z in [-length / 2.0, length / 2.0] {
            let on_cap = |point: Point2<f64>| {
                corner([point.x, point.y, z], 0.5 + 0.5 * point.x / radius, 0.5 + 0.5 * point.y / radius)
            };
            triangles.push([on_cap(Point2::origin()), on_cap(a), on_cap(b)]);
        }
    }
    triangles
}

/// An ellipsoid around the origin.
pub(crate) fn ellipsoid(radii: [f64; 3]) -> Vec<Triangle> {
    round(radii, |_| 0.0)
}

/// A cylinder of this length along z with a hemisphere on each end.
pub(crate) fn capsule(radius: f64, length: f64) -> Vec<Triangle> {
    round([radius; 3], |latitude| if latitude < 0.0 { -length / 2.0 } else { length / 2.0 })
}

/// A polygon raised from z = 0 to `height`: its sides and its two ends.
pub(crate) fn extrusion(outline: &[Point2<f64>], height: f64) -> Vec<Triangle> {
    let mut triangles = prism(outline, 0.0, height);
    for [a, b, c] in ears(outline) {
        for z in [0.0, height] {
            triangles.push([a, b, c].map(|point| corner([point.x, point.y, z], point.x, point.y)));
        }
    }
    triangles
}

fn circle(side: usize, radius: f64) -> Point2<f64> {
    let (sin, cos) = (TAU * side as f64 / SIDES as f64).sin_cos();
    Point2::new(radius * cos, radius * sin)
}

/// The sides above a closed outline.
fn prism(outline: &[Point2<f64>], bottom: f64, top: f64) -> Vec<Triangle> {
    let count = outline.len();
    let side = |index: usize| {
        let (a, b) = (outline[index], outline[(index + 1) % count]);
        let [left, right] = [index, index + 1].map(|index| index as f64 / count as f64);
        let at = |point: Point2<f64>, u: f64, z: f64, v: f64| corner([point.x, point.y, z], u, v);
        let (low, high) =
            ((at(a, left, bottom, 0.0), at(b, right, bottom, 0.0)), (at(a, left, top, 1.0), at(b, right, top, 1.0)));
        [[low.0, low.1, high.1], [low.0, high.1, high.0]]
    };
    (0..count).flat_map(side).collect()
}

fn round(radii: [f64; 3], lift: impl Fn(f64) -> f64) -> Vec<Triangle> {
    let at = |side: usize, row: usize, latitude_of_lift: f64| {
        let latitude = -FRAC_PI_2 + PI * row as f64 / ROWS as f64;
        let rim = circle(side, latitude.cos());
        let position = [rim.x * radii[0], rim.y * radii[1], latitude.sin() * radii[2] + lift(latitude_of_lift)];
        corner(position, side as f64 / SIDES as f64, row as f64 / ROWS as f64)
    };
    let mut triangles = Vec::with_capacity(2 * SIDES * ROWS);
    let mut band = |row: usize, next: usize, low: f64, high: f64| {
        for side in 0..SIDES {
            let (a, b) = (at(side, row, low), at(side + 1, row, low));
            let (c, d) = (at(side + 1, next, high), at(side, next, high));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    };
    for row in 0..ROWS {
        let half = if row < ROWS / 2 { -1.0 } else { 1.0 };
        band(row, row + 1, half, half);
    }
    if lift(1.0) > lift(-1.0) {
        band(ROWS / 2, ROWS / 2, -1.0, 1.0);
    }
    triangles
}

/// A simple polygon cut into triangles by ear clipping. If it crosses itself, the remainder is
/// dropped.
fn ears(outline: &[Point2<f64>]) -> Vec<[Point2<f64>; 3]> {
    let cross = |a: Point2<f64>, b: Point2<f64>, c: Point2<f64>| (b - a).perp(&(c - a));
    let area: f64 = (0..outline.len())
        .map(|index| {
            let (a, b): (Vector2<f64>, Vector2<f64>) =
                (outline[index].coords, outline[(index + 1) % outline.len()].coords);
            a.perp(&b)
        })
        .sum();
    let mut rest = outline.to_vec();
    if area < 0.0 {
        rest.reverse();
    }
    let mut triangles = Vec::new();
    while rest.len() >= 3 {
        let count = rest.len();
        let ear = (0..count).find(|&index| {
            let (a, b, c) = (rest[(index + count - 1) % count], rest[index], rest[(index + 1) % count]);
            let holds = |point: Point2<f64>| {
                point != a
                    && point != b
                    && point != c
                    && cross(a, b, point) >= 0.0
                    && cross(b, c, point) >= 0.0
                    && cross(c, a, point) >= 0.0
            };
            cross(a, b, c) > 0.0 && !rest.iter().any(|&point| holds(point))
        });
        let Some(index) = ear else { break };
        triangles.push([rest[(index + count - 1) % count], rest[index], rest[(index + 1) % count]]);
        rest.remove(index);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::{Triangle, capsule, cuboid, cylinder, ellipsoid, extrusion};
    use nalgebra::{Point2, Vector3};
    use std::f64::consts::PI;

    fn area(triangles: &[Triangle]) -> f64 {
        let of = |triangle: &Triangle| {
            let [a, b, c] = triangle.map(|corner| Vector3::from(corner.position));
            (b - a).cross(&(c - a)).norm() / 2.0
        };
        triangles.iter().map(of).sum()
    }

    #[test]
    fn surfaces_have_their_areas() {
        assert!((area(&cuboid([1.0, 2.0, 3.0])) - 22.0).abs() < 1e-9);
        assert!((area(&cylinder(1.0, 2.0)) / (6.0 * PI) - 1.0).abs() < 0.01);
        assert!((area(&ellipsoid([1.0; 3])) / (4.0 * PI) - 1.0).abs() < 0.02);
        assert!((area(&capsule(1.0, 2.0)) / (8.0 * PI) - 1.0).abs() < 0.02);
        let ell = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)];
        let ell: Vec<Point2<f64>> = ell.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        assert!((area(&extrusion(&ell, 1.0)) - (2.0 * 3.0 + 8.0)).abs() < 1e-9);
        let clockwise: Vec<Point2<f64>> = ell.into_iter().rev().collect();
        assert!((area(&extrusion(&clockwise, 1.0)) - (2.0 * 3.0 + 8.0)).abs() < 1e-9);
    }
}
