//! Polygons of a floor plan, metres in the world frame.

use fht_perception::pose::Point2;
use i_overlay::core::fill_rule::FillRule;
use i_overlay::float::simplify::SimplifyShape;

/// A polygon, counter-clockwise, metres.
pub(crate) type Polygon = Vec<Point2>;

/// The outer walls of a floor that is the union of rooms: closed rings with the floor on the left.
pub(crate) fn union(rooms: &[Polygon]) -> Vec<Polygon> {
    let shapes: Vec<Vec<[f64; 2]>> =
        rooms.iter().map(|room| room.iter().map(|corner| [corner.x, corner.y]).collect()).collect();
    let union = shapes.simplify_shape(FillRule::NonZero);
    let ring = |ring: Vec<[f64; 2]>| ring.into_iter().map(|[x, y]| Point2::new(x, y)).collect();
    union.into_iter().flatten().map(ring).collect()
}

/// Indices of the cells of side `resolution_m` whose centres lie in an odd number of the polygons.
pub(crate) fn cells_inside(
    polygons: &[Polygon],
    origin: Point2,
    resolution_m: f64,
    (width, height): (usize, usize),
) -> Vec<usize> {
    let mut inside = Vec::new();
    let row_of = |y: f64| ((y - origin.y) / resolution_m - 0.5).max(0.0);
    let low = polygons.iter().flatten().map(|corner| corner.y).fold(f64::MAX, f64::min);
    let high = polygons.iter().flatten().map(|corner| corner.y).fold(f64::MIN, f64::max);
    let rows = row_of(low) as usize..(row_of(high).ceil() as usize + 1).min(height);
    for row in rows {
        let y = origin.y + (row as f64 + 0.5) * resolution_m;
        let mut crossings: Vec<f64> = polygons
            .iter()
            .flat_map(|polygon| sides(polygon))
            .filter(|(a, b)| (a.y <= y) != (b.y <= y))
            .map(|(a, b)| a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x))
            .collect();
        crossings.sort_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            let column_of = |x: f64| ((x - origin.x) / resolution_m - 0.5).ceil().max(0.0) as usize;
            let columns = column_of(pair[0])..column_of(pair[1]).min(width);
            inside.extend(columns.map(|column| row * width + column));
        }
    }
    inside
}

/// The sides of a closed polygon.
pub(crate) fn sides(polygon: &[Point2]) -> impl Iterator<Item = (Point2, Point2)> + '_ {
    polygon.iter().copied().zip(polygon.iter().copied().cycle().skip(1))
}

/// Whether a polygon contains a point.
pub(crate) fn holds(polygon: &[Point2], point: Point2) -> bool {
    let crossed = |&(a, b): &(Point2, Point2)| {
        (a.y <= point.y) != (b.y <= point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    sides(polygon).filter(crossed).count() % 2 == 1
}

/// The rectangle between two corners.
pub(crate) fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    let (x0, x1) = (x0.min(x1), x0.max(x1));
    let (y0, y1) = (y0.min(y1), y0.max(y1));
    [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Point2::new(x, y)).to_vec()
}

/// A strip of constant width around a segment.
pub(crate) fn strip(from: Point2, to: Point2, width_m: f64) -> Polygon {
    let along = to - from;
    let length = along.norm().max(1e-9);
    let side = nalgebra::Vector2::new(-along.y, along.x) * (width_m / 2.0 / length);
    vec![from - side, to - side, to + side, from + side]
}

/// A regular polygon.
pub(crate) fn regular(centre: Point2, radius_m: f64, corners: u32, turn_rad: f64) -> Polygon {
    let corner = |index: u32| {
        let angle = turn_rad + f64::from(index) / f64::from(corners) * std::f64::consts::TAU;
        Point2::new(centre.x + radius_m * angle.cos(), centre.y + radius_m * angle.sin())
    };
    (0..corners).map(corner).collect()
}

/// A box turned by `turn_rad` around its centre.
pub(crate) fn turned_box(centre: Point2, width_m: f64, depth_m: f64, turn_rad: f64) -> Polygon {
    let (sin, cos) = turn_rad.sin_cos();
    let corner = |x: f64, y: f64| Point2::new(centre.x + x * cos - y * sin, centre.y + x * sin + y * cos);
    let (w, d) = (width_m / 2.0, depth_m / 2.0);
    vec![corner(-w, -d), corner(w, -d), corner(w, d), corner(-w, d)]
}
