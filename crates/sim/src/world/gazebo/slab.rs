//! What a robot can hit: the part of a surface between two heights, seen from above.
//!
//! Bumper, scanner and true plan are all made from it, so they agree. A scanner with one thin plane
//! would look over the feet of chairs and under the car of a lift, and the robot would hit what it
//! cannot see.

use nalgebra::{Point2, Point3};

/// Heights between which a robot's body is solid and its scanner sees, metres: within 6 cm of the
/// scanner's mount, like scans made from point clouds that are cropped to a range of heights. The
/// robot rolls over what is lower, and drives under what is higher, such as tables. The camera's
/// mast is thin and is ignored.
pub(crate) const SLAB_M: [f64; 2] = [0.122, 0.242];
/// An outline with less than this doubled area counts as a line, square metres.
const LINE_M2: f64 = 1e-7;

/// The convex outline of the part of a triangle in the slab: two points if the triangle is
/// vertical. `None` if no part is in the slab.
pub(crate) fn outline(triangle: &[Point3<f64>; 3]) -> Option<Vec<Point2<f64>>> {
    let [low, high] = SLAB_M;
    let all = |test: fn(f64, f64) -> bool, bound: f64| triangle.iter().all(|corner| test(corner.z, bound));
    if all(|z, low| z < low, low) || all(|z, high| z > high, high) {
        return None;
    }
    let above = clipped(triangle, |z| z - low);
    let within = clipped(&above, |z| high - z);
    let flat: Vec<Point2<f64>> = within.iter().map(Point3::xy).collect();
    let (&first, rest) = flat.split_first()?;
    let doubled_area: f64 = rest.windows(2).map(|pair| (pair[0] - first).perp(&(pair[1] - first))).sum::<f64>().abs();
    if doubled_area > LINE_M2 {
        return Some(flat);
    }
    let farthest_from = |from: Point2<f64>| {
        flat.iter().copied().max_by(|a, b| (a - from).norm_squared().total_cmp(&(b - from).norm_squared()))
    };
    let end = farthest_from(first)?;
    Some(vec![farthest_from(end)?, end])
}

/// The part of a convex polygon where `inside` of the height is not negative.
fn clipped(polygon: &[Point3<f64>], inside: impl Fn(f64) -> f64) -> Vec<Point3<f64>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, &from) in polygon.iter().enumerate() {
        let to = polygon[(index + 1) % polygon.len()];
        let (a, b) = (inside(from.z), inside(to.z));
        if a >= 0.0 {
            kept.push(from);
        }
        if (a < 0.0) != (b < 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::{SLAB_M, outline};
    use nalgebra::Point3;

    #[test]
    fn upright_triangles_become_lines() {
        let [low, high] = SLAB_M;
        let wall = [Point3::new(0.0, 0.0, 0.0), Point3::new(2.0, 0.0, 0.0), Point3::new(0.0, 0.0, 2.0)];
        let line = outline(&wall).unwrap();
        assert_eq!(line.len(), 2);
        let mut ends: Vec<f64> = line.iter().map(|point| point.x).collect();
        ends.sort_by(f64::total_cmp);
        assert!((ends[0]).abs() < 1e-9 && (ends[1] - (2.0 - low)).abs() < 1e-9, "{ends:?} {high}");
    }

    #[test]
    fn what_is_above_or_below_is_left_out() {
        let at = |z: f64| [Point3::new(0.0, 0.0, z), Point3::new(1.0, 0.0, z), Point3::new(0.0, 1.0, z)];
        assert!(outline(&at(0.0)).is_none());
        assert!(outline(&at(0.7)).is_none());
        assert_eq!(outline(&at(0.15)).unwrap().len(), 3);
    }
}
