//! A building as plain data: where the floor is, what stands on it, how the walls look. From this
//! the scene and the plan are made.

use crate::plan::{FloorPlan, PLAN_RESOLUTION_M};
use crate::world::building::polygon::{Polygon, cells_inside};
use crate::world::building::zones::Zones;
use crate::world::draw::furniture::Kind;
use crate::world::draw::surfaces::Ceiling;
use fht_perception::pose::Point2;
use std::collections::BTreeMap;

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
    /// Distinguishes things of one kind: those with the same number look the same.
    pub(crate) variant: u32,
}

/// Where a wall stands that is not where it was drawn. It keeps its looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Placement {
    /// Removed.
    Gone,
    /// Moved by this vector, metres.
    Moved(nalgebra::Vector2<f64>),
}

/// A building.
#[derive(Clone, Debug)]
pub(crate) struct Layout<Style> {
    /// The outer walls: closed rings with the floor on the left.
    pub(crate) rings: Vec<Polygon>,
    /// Those walls, by index, that are not where they were drawn.
    pub(crate) displaced: BTreeMap<usize, Placement>,
    /// What stands in it.
    pub(crate) solids: Vec<Solid>,
    /// How parts of it look; the first that contains a point counts.
    pub(crate) zones: Zones<Style>,
    /// How the rest looks.
    pub(crate) elsewhere: Style,
    /// Height of the ceiling, metres.
    pub(crate) ceiling_m: f64,
    /// What the ceiling looks like.
    pub(crate) ceiling: Ceiling,
}

impl<Style> Layout<Style> {
    /// Index of the zone at a point; the number of zones if there is none.
    pub(crate) fn zone_at(&self, point: Point2) -> usize {
        self.zones.index_at(point)
    }

    /// The look at a point.
    pub(crate) fn style_at(&self, point: Point2) -> &Style {
        self.zones.get(self.zone_at(point)).unwrap_or(&self.elsewhere)
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
