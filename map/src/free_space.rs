//! Where a robot's centre may be, as a mesh of triangles: the nodes' rectangles and the edges' corridors together, less the
//! robot's half width. Rectangles that overlap or touch are one space, and the way from one to the next is as wide as what
//! they share.
//!
//! Everything is counted in whole millimetres, so that robot and server get the same mesh of the same map.

use crate::approach::ApproachConfig;
use crate::seen_walls::SeenWalls;
use crate::state::{MapState, NodeRef};
use crate::view::View;
use fht_proto::{EdgeKey, FixedPoint};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::Overlay;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::core::simplify::Simplify;
use i_overlay::i_float::int::angle::Angle;
use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::{IntContour, IntShapes};
use i_overlay::mesh::int::arc::ArcOptions;
use i_overlay::mesh::int::outline::offset::IntOutlineOffset;
use i_overlay::mesh::int::style::{IntLineJoin, IntOutlineStyle};
use i_triangle::int::triangulatable::IntTriangulatable;
use std::collections::{BTreeMap, BTreeSet};

/// How free space is made of a map.
#[derive(Clone, Debug, PartialEq)]
pub struct SpaceConfig {
    /// The robot's centre keeps this far from the border of free space, millimetres. Default 160: the robot's 105, the 30 by
    /// which a corner may stand out of a wall's occupied cells, and 25 of which map and driving may be off.
    pub half_width_mm: u16,
    /// Half width of the corridor that an edge promises, millimetres. Default 165: little more than the half width, so that
    /// the way leads along the edge's line. Around that line 0.13 m are free and no more, and corners that a wider corridor
    /// covers would be cut.
    pub corridor_mm: u16,
    /// Places where something stands that the map does not know. Default none.
    pub blocked: BTreeSet<FixedPoint>,
    /// It reaches this far around such a place, millimetres. Default 300.
    pub blocked_radius_mm: u16,
    /// Polygons that no robot's centre may enter. Default none.
    pub keep_out: Vec<Vec<FixedPoint>>,
    /// Edges that nobody may use. Default none.
    pub closed: BTreeSet<EdgeKey>,
    /// How places outside join it.
    pub approach: ApproachConfig,
}

impl Default for SpaceConfig {
    fn default() -> Self {
        Self {
            half_width_mm: 160,
            corridor_mm: 165,
            blocked: BTreeSet::new(),
            blocked_radius_mm: 300,
            keep_out: Vec::new(),
            closed: BTreeSet::new(),
            approach: ApproachConfig::default(),
        }
    }
}

/// A corner of the mesh: millimetres in the map frame.
pub(crate) type Corner = [f64; 2];

/// A triangle of the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Triangle {
    /// Its corners, counter-clockwise.
    pub(crate) corners: [u32; 3],
    /// The triangle beyond the side from corner `i` to corner `i + 1`.
    pub(crate) beyond: [Option<u32>; 3],
    /// Triangles that hang together have the same number.
    pub(crate) part: u32,
}

/// Free space as a mesh.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    pub(crate) corners: Vec<Corner>,
    /// By the least x of their corners.
    pub(crate) triangles: Vec<Triangle>,
    /// Greatest x of the triangles up to each.
    reach_x: Vec<f64>,
    /// Edges that something stands on.
    pub(crate) closed: BTreeSet<EdgeKey>,
    /// What the ways from places outside must keep away from.
    pub(crate) walls: SeenWalls,
    /// The ground that they had better lead over: what scanners saw, and rectangles, least and greatest corner.
    pub(crate) views: Vec<View>,
    pub(crate) rectangles: Vec<[Corner; 2]>,
    pub(crate) approach: ApproachConfig,
}

/// A place in the mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub(crate) triangle: u32,
    pub(crate) part: u32,
    pub(crate) place: Corner,
}

impl FreeSpace {
    /// The free space of a map.
    #[must_use]
    pub fn of(map: &MapState, config: &SpaceConfig) -> Self {
        let rectangles: Vec<IntContour<i32>> = map.nodes().filter_map(|node| rectangle(&node)).collect();
        let views: Vec<View> = map.main_nodes().filter_map(|node| View::of(&node)).collect();
        let walls = SeenWalls::of(&views);
        let place = |id| map.node(id).map(|node| node.pose.position);
        let ends = |edge: EdgeKey| Some((place(edge.low())?, place(edge.high())?));
        let short = |edge: EdgeKey| ends(edge).filter(|(a, b)| a.distance(*b) <= LONGEST_EDGE_M);
        let lines = map.edges().filter_map(short).map(|(a, b)| [corner_of(a), corner_of(b)]);
        let as_corner = |it: IntPoint<i32>| [f64::from(it.x), f64::from(it.y)];
        let low_and_high: Vec<[Corner; 2]> =
            rectangles.iter().filter_map(|it| Some([as_corner(*it.first()?), as_corner(*it.get(2)?)])).collect();
        let is_inside = |place: Corner| is_deep_inside(&low_and_high, place);
        let things = walls.things(&views, is_inside, lines, EDGE_ROOM_MM);
        let corridors = map.edges().filter_map(short).filter_map(|(a, b)| corridor(a, b, config.corridor_mm));
        let contours: Vec<IntContour<i32>> = rectangles.into_iter().chain(corridors).collect();
        let mut free = union(contours);
        let radius_mm = f64::from(config.blocked_radius_mm);
        let blocked = config.blocked.iter().map(|at| octagon(*at, radius_mm).collect());
        let things = things.into_iter().map(|place| octagon(fixed_point(place), THING_MM).collect());
        let obstacles: Vec<IntContour<i32>> = blocked.chain(things).collect();
        if !obstacles.is_empty() {
            let obstacles = union(obstacles);
            free = Overlay::from_subj_and_clip(&free, &obstacles).overlay(OverlayRule::Difference, FillRule::NonZero);
        }
        let reach_m = (radius_mm + f64::from(config.half_width_mm)) * 1e-3;
        let is_blocked =
            |a: FixedPoint, b: FixedPoint| config.blocked.iter().any(|at| from_segment_m(*at, a, b) < reach_m);
        let closed = map.edges().filter(|edge| ends(*edge).is_some_and(|(a, b)| is_blocked(a, b))).collect();
        let mesh = Self::of_shapes(&free, config.half_width_mm);
        Self { closed, walls, views, rectangles: low_and_high, approach: config.approach.clone(), ..mesh }
    }

    fn of_shapes(free: &IntShapes<i32>, half_width_mm: u16) -> Self {
        // Corners of walls are rounded by steps of 11.25°: at most 0.5 % nearer than asked for.
        let round = IntLineJoin::Round(ArcOptions { max_step: Angle::from_bits(1 << 27), ..ArcOptions::default() });
        let style = IntOutlineStyle::new(-i32::from(half_width_mm)).line_join(round);
        let Ok(shapes) = free.validate_outline(&style).and_then(|()| free.outline(&style)) else {
            return Self::default();
        };
        let delaunay = shapes.triangulate().into_delaunay();
        let corners: Vec<Corner> = delaunay.points.iter().map(|p| [f64::from(p.x), f64::from(p.y)]).collect();
        let indices: Vec<u32> = delaunay.triangle_indices();
        let mut triangles: Vec<[u32; 3]> = indices
            .chunks_exact(3)
            .filter_map(|chunk| {
                let &[a, b, c] = chunk else { return None };
                let area = cross(corners[a as usize], corners[b as usize], corners[c as usize]);
                // Counter-clockwise; slivers without an area are nowhere.
                (area != 0.0).then_some(if area > 0.0 { [a, b, c] } else { [a, c, b] })
            })
            .collect();
        let least_x = |t: &[u32; 3]| t.iter().map(|&c| corners[c as usize][0]).fold(f64::INFINITY, f64::min);
        triangles.sort_by(|a, b| least_x(a).total_cmp(&least_x(b)).then(a.cmp(b)));
        Self::joined(corners, &triangles)
    }

    /// Finds the neighbours.
    fn joined(corners: Vec<Corner>, triangles: &[[u32; 3]]) -> Self {
        let mut side_of: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for (index, triangle) in triangles.iter().enumerate() {
            for side in 0..3 {
                side_of.insert((triangle[side], triangle[(side + 1) % 3]), index as u32);
            }
        }
        let beyond = |t: &[u32; 3]| [0, 1, 2].map(|side| side_of.get(&(t[(side + 1) % 3], t[side])).copied());
        let mut triangles: Vec<Triangle> =
            triangles.iter().map(|t| Triangle { corners: *t, beyond: beyond(t), part: u32::MAX }).collect();
        for first in 0..triangles.len() {
            let mut waiting = vec![first];
            while let Some(index) = waiting.pop() {
                if triangles[index].part == u32::MAX {
                    triangles[index].part = first as u32;
                    waiting.extend(triangles[index].beyond.iter().flatten().map(|&next| next as usize));
                }
            }
        }
        let mut reach = f64::NEG_INFINITY;
        let greatest_x =
            |t: &Triangle| t.corners.iter().map(|&c| corners[c as usize][0]).fold(f64::NEG_INFINITY, f64::max);
        let mut reach_x = Vec::with_capacity(triangles.len());
        for triangle in &triangles {
            reach = reach.max(greatest_x(triangle));
            reach_x.push(reach);
        }
        Self { corners, triangles, reach_x, ..Self::default() }
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    pub(crate) fn corner(&self, index: u32) -> Corner {
        self.corners[index as usize]
    }

    /// The triangle that a place lies in.
    pub(crate) fn triangle_at(&self, place: Corner) -> Option<u32> {
        let end = self.triangles.partition_point(|triangle| {
            triangle.corners.iter().map(|&c| self.corner(c)[0]).fold(f64::INFINITY, f64::min) <= place[0]
        });
        let candidates = (0..end).rev().take_while(|&index| self.reach_x[index] >= place[0]);
        candidates.map(|index| index as u32).find(|&index| self.contains(index, place))
    }

    fn contains(&self, triangle: u32, place: Corner) -> bool {
        let [a, b, c] = self.triangles[triangle as usize].corners.map(|corner| self.corner(corner));
        cross(a, b, place) >= 0.0 && cross(b, c, place) >= 0.0 && cross(c, a, place) >= 0.0
    }

    /// The border of the mesh: triangles and their sides that no other triangle is beyond.
    pub(crate) fn borders(&self) -> impl Iterator<Item = (u32, [Corner; 2])> + '_ {
        self.triangles.iter().zip(0..).flat_map(move |(triangle, index)| {
            let open = (0..3).filter(|&side| triangle.beyond[side].is_none());
            open.map(move |side| {
                (index, [triangle.corners[side], triangle.corners[(side + 1) % 3]].map(|c| self.corner(c)))
            })
        })
    }
}

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
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// The foot of the perpendicular from a place to the line through `a` and `b`, as a share of the way from `a` to `b`.
pub(crate) fn foot_share([a, b]: [Corner; 2], place: Corner) -> f64 {
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    ((place[0] - a[0]) * along[0] + (place[1] - a[1]) * along[1]) / squared.max(f64::MIN_POSITIVE)
}

/// A place between two others.
pub(crate) fn between([a, b]: [Corner; 2], share: f64) -> Corner {
    [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
}

pub(crate) fn nearest_on(ends: [Corner; 2], place: Corner) -> Corner {
    between(ends, foot_share(ends, place).clamp(0.0, 1.0))
}

/// The union of contours: of either half of them first. Of hundreds that overlap, each would meet each; of two halves only
/// borders meet.
fn union(mut contours: Vec<IntContour<i32>>) -> IntShapes<i32> {
    if contours.len() <= UNION_AT_ONCE {
        return contours.simplify(FillRule::NonZero, Default::default());
    }
    let extent = |axis: fn(&IntPoint<i32>) -> i32| {
        let all = contours.iter().flatten().map(axis);
        let (least, greatest) =
            all.fold((i32::MAX, i32::MIN), |(least, greatest), at| (least.min(at), greatest.max(at)));
        i64::from(greatest) - i64::from(least)
    };
    let axis: fn(&IntPoint<i32>) -> i32 = if extent(|p| p.x) > extent(|p| p.y) { |p| p.x } else { |p| p.y };
    contours.sort_by_cached_key(|contour| contour.iter().map(axis).min());
    let others = contours.split_off(contours.len() / 2);
    Overlay::from_subj_and_clip(&union(contours), &union(others)).overlay(OverlayRule::Union, FillRule::NonZero)
}

/// So many contours are put together at once.
const UNION_AT_ONCE: usize = 8;

/// Edges that are longer make no corridors, metres: no explorer sees so far, and a corridor costs by its length.
const LONGEST_EDGE_M: f64 = 100.0;
/// What stands in free space is this large around each place where it was seen, millimetres.
const THING_MM: f64 = 30.0;
/// What is nearer than this to an edge's line cannot be there, as the edge says, millimetres.
const EDGE_ROOM_MM: f64 = 110.0;
/// What is nearer than this to the border of all rectangles together is the wall behind it, millimetres.
const BORDER_MM: f64 = 50.0;

/// Whether a place lies inside rectangles, least and greatest corner, well away from the border of all of them together.
fn is_deep_inside(rectangles: &[[Corner; 2]], place: Corner) -> bool {
    let contains = |[low, high]: &[Corner; 2], at: Corner, margin_mm: f64| {
        (0..2).all(|axis| at[axis] > low[axis] + margin_mm && at[axis] < high[axis] - margin_mm)
    };
    if rectangles.iter().any(|it| contains(it, place, BORDER_MM)) {
        return true;
    }
    let near: Vec<&[Corner; 2]> = rectangles.iter().filter(|it| contains(it, place, -BORDER_MM)).collect();
    (0..8).all(|eighth| {
        let (sin, cos) = (f64::from(eighth) * std::f64::consts::FRAC_PI_4).sin_cos();
        let beside = [place[0] + BORDER_MM * cos, place[1] + BORDER_MM * sin];
        near.iter().any(|it| contains(it, beside, 0.0))
    })
}

fn rectangle(node: &NodeRef<'_>) -> Option<IntContour<i32>> {
    let (rect, at) = (node.free_space?, node.pose.position);
    let x = [at.x_mm.saturating_sub(rect.west_mm.into()), at.x_mm.saturating_add(rect.east_mm.into())];
    let y = [at.y_mm.saturating_sub(rect.south_mm.into()), at.y_mm.saturating_add(rect.north_mm.into())];
    let is_flat = x[0] == x[1] || y[0] == y[1];
    (!is_flat).then(|| vec![point(x[0], y[0]), point(x[1], y[0]), point(x[1], y[1]), point(x[0], y[1])])
}

fn point(x: i32, y: i32) -> IntPoint<i32> {
    IntPoint::new(x, y)
}

/// The corridor around an edge, with half an octagon at either end: a robot may stand at a node and turn.
fn corridor(from: FixedPoint, to: FixedPoint, half_width_mm: u16) -> Option<IntContour<i32>> {
    let ([x0, y0], [x1, y1]) = (corner_of(from), corner_of(to));
    let (dx, dy) = (x1 - x0, y1 - y0);
    let length = dx.hypot(dy);
    if length < 1.0 {
        return None;
    }
    let radius = f64::from(half_width_mm) / std::f64::consts::FRAC_PI_8.cos();
    let heading = dy.atan2(dx);
    let eighth = std::f64::consts::FRAC_PI_4;
    let half = |at: FixedPoint, first: f64| {
        (0..4).map(move |k| corner_at(at, radius, heading + first + (f64::from(k) + 0.5) * eighth))
    };
    Some(half(to, -2.0 * eighth).chain(half(from, 2.0 * eighth)).collect())
}

/// The corner of an octagon around a place.
fn corner_at(centre: FixedPoint, radius_mm: f64, angle: f64) -> IntPoint<i32> {
    let offset = |value: f64| (radius_mm * value).round() as i32;
    point(centre.x_mm.saturating_add(offset(angle.cos())), centre.y_mm.saturating_add(offset(angle.sin())))
}

/// An octagon around a place, counter-clockwise.
fn octagon(centre: FixedPoint, radius_mm: f64) -> impl Iterator<Item = IntPoint<i32>> {
    (0..8).map(move |k| corner_at(centre, radius_mm, (f64::from(k) + 0.5) * std::f64::consts::FRAC_PI_4))
}

/// Distance of a place from the straight line between two others, metres.
fn from_segment_m(at: FixedPoint, a: FixedPoint, b: FixedPoint) -> f64 {
    let [at, a, b] = [at, a, b].map(corner_of);
    distance(nearest_on([a, b], at), at) * 1e-3
}
