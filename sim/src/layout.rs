//! A building as plain data: where one can walk, what stands there, how the walls look. Turned into a scene and a plan.

use crate::draw::surfaces::Ceiling;
use crate::plan::{FloorPlan, PLAN_RESOLUTION_M};
use fht_robot::pose::Point2;
use i_overlay::core::fill_rule::FillRule;
use i_overlay::float::simplify::SimplifyShape;
use std::collections::BTreeMap;

/// A polygon, counter-clockwise, metres.
pub(crate) type Polygon = Vec<Point2>;

/// What a thing that stands on the floor is. Everything that reaches down to the LiDAR's plane is solid from the floor up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// A free-standing wall; its faces look like the zone's walls and carry pictures.
    Partition,
    /// A column.
    Pillar,
    /// Books on shelves.
    Bookshelf,
    /// Steel lockers.
    Lockers,
    /// A wooden cupboard.
    Cupboard,
    /// A desk or table.
    Desk,
    /// A computer screen on a desk.
    Screen,
    /// A cloth screen between desks.
    Divider,
    /// A bench or sofa.
    Bench,
    /// What an exhibit stands on.
    Plinth,
    /// An exhibit.
    Exhibit,
    /// A glass case.
    Showcase,
    /// A vending machine.
    Vending,
    /// A pot with a plant.
    Plant,
    /// The frame of a doorway, a pilaster.
    Frame,
}

/// A vertical prism.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    /// Convex footprint.
    pub(crate) footprint: Polygon,
    /// Lower end, metres above the floor.
    pub(crate) bottom_m: f64,
    /// Upper end, metres above the floor.
    pub(crate) top_m: f64,
    /// What it is.
    pub(crate) kind: Kind,
    /// Tells things of one kind apart: the same number looks the same.
    pub(crate) variant: u32,
}

/// Where a wall is that is not where it was drawn. It keeps its looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Placement {
    /// Nowhere.
    Gone,
    /// So far away, metres.
    Moved(nalgebra::Vector2<f64>),
}

/// A building.
#[derive(Clone, Debug)]
pub(crate) struct Layout<Style> {
    /// The outer walls: closed rings with the floor on the left.
    pub(crate) rings: Vec<Polygon>,
    /// Those of them that are not where they were drawn.
    pub(crate) displaced: BTreeMap<usize, Placement>,
    /// What stands in it.
    pub(crate) solids: Vec<Solid>,
    /// How parts of it look; the first that holds a point counts.
    pub(crate) zones: Vec<(Polygon, Style)>,
    /// How the rest looks.
    pub(crate) elsewhere: Style,
    /// Height of the ceiling, metres.
    pub(crate) ceiling_m: f64,
    /// What the ceiling looks like.
    pub(crate) ceiling: Ceiling,
}

/// The outer walls of a floor that is the union of rooms: closed rings with the floor on the left.
pub(crate) fn union(rooms: &[Polygon]) -> Vec<Polygon> {
    let shapes: Vec<Vec<[f64; 2]>> =
        rooms.iter().map(|room| room.iter().map(|corner| [corner.x, corner.y]).collect()).collect();
    let union = shapes.simplify_shape(FillRule::NonZero);
    let ring = |ring: Vec<[f64; 2]>| ring.into_iter().map(|[x, y]| Point2::new(x, y)).collect();
    union.into_iter().flatten().map(ring).collect()
}

impl<Style> Layout<Style> {
    /// Index of the zone at a point; the number of zones for elsewhere.
    pub(crate) fn zone_at(&self, point: Point2) -> usize {
        self.zones.iter().position(|(area, _)| holds(area, point)).unwrap_or(self.zones.len())
    }

    /// The look at a point.
    pub(crate) fn style_at(&self, point: Point2) -> &Style {
        self.zones.get(self.zone_at(point)).map_or(&self.elsewhere, |(_, style)| style)
    }

    /// The true plan, with a border of two occupied cells.
    pub(crate) fn plan(&self) -> FloorPlan {
        let border = 2.0 * PLAN_RESOLUTION_M;
        let corners = || self.rings.iter().flatten();
        let low = corners().fold(Point2::new(f64::MAX, f64::MAX), |low, c| Point2::new(low.x.min(c.x), low.y.min(c.y)));
        let high =
            corners().fold(Point2::new(f64::MIN, f64::MIN), |high, c| Point2::new(high.x.max(c.x), high.y.max(c.y)));
        let cells = |from: f64, to: f64| ((to - from + 2.0 * border) / PLAN_RESOLUTION_M).ceil().max(1.0) as usize;
        let (width, height) = (cells(low.x, high.x), cells(low.y, high.y));
        let origin = Point2::new(low.x - border, low.y - border);
        let mut occupied = vec![true; width * height];
        let mut paint = |polygons: &[Polygon], value: bool| {
            for index in cells_inside(polygons, origin, PLAN_RESOLUTION_M, (width, height)) {
                occupied[index] = value;
            }
        };
        paint(&self.rings, false);
        for solid in self.solids.iter().filter(|solid| solid.bottom_m <= 0.0) {
            paint(std::slice::from_ref(&solid.footprint), true);
        }
        FloorPlan::new(PLAN_RESOLUTION_M, origin, width, height, occupied)
    }
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

/// Whether a polygon holds a point.
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
