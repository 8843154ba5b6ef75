//! Places and lines in the plane, millimetres in the map frame.
//!
//! Only sums, products, quotients and square roots: they are rounded in one way everywhere, so that
//! robot and server agree.

use fht_proto::FixedPoint;

/// A place: millimetres in the map frame.
pub(crate) type Corner = [f64; 2];

/// A place of the map, exactly.
pub(crate) fn corner_of(place: FixedPoint) -> Corner {
    [f64::from(place.x_mm), f64::from(place.y_mm)]
}

/// The place of the map that is nearest to a corner.
pub(crate) fn fixed_point(corner: Corner) -> FixedPoint {
    FixedPoint { x_mm: corner[0].round() as i32, y_mm: corner[1].round() as i32 }
}

/// Twice the signed area of a triangle: positive if it is counter-clockwise.
pub(crate) fn cross(a: Corner, b: Corner, c: Corner) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

pub(crate) fn distance(a: Corner, b: Corner) -> f64 {
    squared_distance(a, b).sqrt()
}

pub(crate) fn squared_distance(a: Corner, b: Corner) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy
}

/// The foot of the perpendicular from a place to the line through `a` and `b`, as a share of the
/// way from `a` to `b`.
pub(crate) fn foot_share([a, b]: [Corner; 2], place: Corner) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    ((place[0] - a[0]) * along[0] + (place[1] - a[1]) * along[1]) / squared.max(f64::MIN_POSITIVE)
}

/// A place between two others.
pub(crate) fn between([a, b]: [Corner; 2], share: f64) -> Corner {
    [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
}

/// The place of a line that is nearest to a place.
pub(crate) fn nearest_on(ends: [Corner; 2], place: Corner) -> Corner {
    between(ends, foot_share(ends, place).clamp(0.0, 1.0))
}

/// Distance of a place from the straight line between two others, metres.
pub(crate) fn from_segment_m(at: FixedPoint, a: FixedPoint, b: FixedPoint) -> f64 {
    let [at, a, b] = [at, a, b].map(corner_of);
    distance(nearest_on([a, b], at), at) * 1e-3
}

/// Whether two straight lines between places meet.
pub(crate) fn meet([a, b]: [Corner; 2], [c, d]: [Corner; 2]) -> bool {
    let are_apart = |p: f64, q: f64| (p > 0.0 && q > 0.0) || (p < 0.0 && q < 0.0);
    let boxes_meet =
        (0..2).all(|axis| a[axis].min(b[axis]) <= c[axis].max(d[axis]) && c[axis].min(d[axis]) <= a[axis].max(b[axis]));
    boxes_meet && !are_apart(cross(a, b, c), cross(a, b, d)) && !are_apart(cross(c, d, a), cross(c, d, b))
}
