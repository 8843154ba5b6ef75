//! Where a robot's centre may be, as a mesh of triangles: the nodes' rectangles and the edges' corridors together, less the
//! robot's half width. Rectangles that overlap or touch are one space, and the way from one to the next is as wide as what
//! they share.
//!
//! Everything is counted in whole millimetres, so that robot and server get the same mesh of the same map.

use crate::seen_walls::SeenWalls;
use crate::state::{MapState, NodeRef};
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
#[derive(Clone, Debug, PartialEq, Eq)]
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
}

impl Default for SpaceConfig {
    fn default() -> Self {
        Self { half_width_mm: 160, corridor_mm: 165, blocked: BTreeSet::new(), blocked_radius_mm: 300 }
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
    /// What must not stand between a place outside and where it joins.
    walls: SeenWalls,
}

/// A place in the mesh, or the place of the mesh that is nearest to one outside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub(crate) triangle: u32,
    pub(crate) part: u32,
    pub(crate) place: Corner,
    /// How far outside the place asked for is, millimetres.
    pub(crate) outside_mm: f64,
}

impl FreeSpace {
    /// The free space of a map.
    #[must_use]
    pub fn of(map: &MapState, config: &SpaceConfig) -> Self {
        let rectangles: Vec<IntContour<i32>> = map.nodes().filter_map(|node| rectangle(&node)).collect();
        let walls = SeenWalls::of(map);
        let place = |id| map.node(id).map(|node| node.pose.position);
        let ends = |edge: EdgeKey| Some((place(edge.low())?, place(edge.high())?));
        let exact = |place: FixedPoint| [f64::from(place.x_mm), f64::from(place.y_mm)];
        let lines = map.edges().filter_map(ends).map(|(a, b)| [exact(a), exact(b)]);
        let is_inside = |place: Corner| rectangles.iter().any(|it| is_deep_inside(it, place));
        let things = walls.seen_twice(SEEN_TWICE_MM, is_inside, lines, EDGE_ROOM_MM);
        let corridors = map.edges().filter_map(ends).filter_map(|(a, b)| corridor(a, b, config.corridor_mm));
        let contours: Vec<IntContour<i32>> = rectangles.into_iter().chain(corridors).collect();
        let mut free = contours.simplify(FillRule::NonZero, Default::default());
        let radius_mm = f64::from(config.blocked_radius_mm);
        let blocked = config.blocked.iter().map(|at| octagon(*at, radius_mm).collect());
        let fixed = |place: Corner| FixedPoint { x_mm: place[0].round() as i32, y_mm: place[1].round() as i32 };
        let things = things.into_iter().map(|place| octagon(fixed(place), THING_MM).collect());
        let obstacles: Vec<IntContour<i32>> = blocked.chain(things).collect();
        if !obstacles.is_empty() {
            let obstacles = obstacles.simplify(FillRule::NonZero, Default::default());
            free = Overlay::from_subj_and_clip(&free, &obstacles).overlay(OverlayRule::Difference, FillRule::NonZero);
        }
        let reach_m = (radius_mm + f64::from(config.half_width_mm)) * 1e-3;
        let is_blocked =
            |a: FixedPoint, b: FixedPoint| config.blocked.iter().any(|at| from_segment_m(*at, a, b) < reach_m);
        let closed = map.edges().filter(|edge| ends(*edge).is_some_and(|(a, b)| is_blocked(a, b))).collect();
        Self { closed, walls, ..Self::of_shapes(&free, config.half_width_mm) }
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
        Self { corners, triangles, reach_x, closed: BTreeSet::new(), walls: SeenWalls::default() }
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

    /// Where a place joins the mesh: itself if it lies in it, otherwise the nearest place of every part within `reach_mm` that can
    /// be reached straight without coming near a wall that some node saw; without one, the nearest. Nearest first.
    pub(crate) fn spots(&self, point: FixedPoint, reach_mm: f64) -> Vec<Spot> {
        let place = [f64::from(point.x_mm), f64::from(point.y_mm)];
        if let Some(triangle) = self.triangle_at(place) {
            let part = self.triangles[triangle as usize].part;
            return vec![Spot { triangle, part, place, outside_mm: 0.0 }];
        }
        let mut nearest: BTreeMap<u32, Spot> = BTreeMap::new();
        for (triangle, ends) in self.borders() {
            let spot = self.spot_at(triangle, nearest_on(ends, place), place);
            let kept = nearest.get(&spot.part);
            if spot.outside_mm <= reach_mm && kept.is_none_or(|kept| kept.outside_mm > spot.outside_mm) {
                nearest.insert(spot.part, spot);
            }
        }
        let mut spots: Vec<Spot> = nearest.into_values().map(|spot| self.joint_beside_walls(spot, place)).collect();
        spots.sort_by(Spot::nearer);
        spots
    }

    /// The border of the mesh: triangles and their sides that no other triangle is beyond.
    fn borders(&self) -> impl Iterator<Item = (u32, [Corner; 2])> + '_ {
        self.triangles.iter().zip(0..).flat_map(move |(triangle, index)| {
            let open = (0..3).filter(|&side| triangle.beyond[side].is_none());
            open.map(move |side| {
                (index, [triangle.corners[side], triangle.corners[(side + 1) % 3]].map(|c| self.corner(c)))
            })
        })
    }

    fn spot_at(&self, triangle: u32, at: Corner, from: Corner) -> Spot {
        let part = self.triangles[triangle as usize].part;
        Spot { triangle, part, place: at, outside_mm: distance(at, from) }
    }

    /// The nearest place of the same part that can be reached from `place` without coming near a wall; `nearest` if there is none.
    fn joint_beside_walls(&self, nearest: Spot, place: Corner) -> Spot {
        if self.walls.is_clear([place, nearest.place], JOINT_ROOM_MM[0]) {
            return nearest;
        }
        let farthest_mm = nearest.outside_mm + JOINT_DETOUR_MM;
        let mut joints: Vec<Spot> = Vec::new();
        let own = self.borders().filter(|(index, _)| self.triangles[*index as usize].part == nearest.part);
        for (triangle, ends) in own.filter(|(_, ends)| distance(nearest_on(*ends, place), place) <= farthest_mm) {
            let steps = (distance(ends[0], ends[1]) / JOINT_STEP_MM).ceil().max(1.0);
            let shares = (0..=steps as usize).map(|step| step as f64 / steps);
            let along = shares.map(|share| self.spot_at(triangle, between(ends, share), place));
            joints.extend(along.filter(|spot| spot.outside_mm <= farthest_mm));
        }
        joints.sort_by(Spot::nearer);
        let is_clear = |spot: &&Spot, room_mm: f64| self.walls.is_clear([place, spot.place], room_mm);
        JOINT_ROOM_MM
            .iter()
            .find_map(|room_mm| joints.iter().find(|spot| is_clear(spot, *room_mm)))
            .copied()
            .unwrap_or(nearest)
    }
}

impl Spot {
    fn nearer(&self, other: &Self) -> std::cmp::Ordering {
        self.outside_mm
            .total_cmp(&other.outside_mm)
            .then(self.part.cmp(&other.part))
            .then(self.triangle.cmp(&other.triangle))
    }
}

/// Room that the way into the mesh keeps from walls, millimetres: rather more than the robot's radius, else what is left of it when
/// a scan is off.
const JOINT_ROOM_MM: [f64; 2] = [130.0, 95.0];
/// They are this much longer than the shortest at most, millimetres: what leads farther over unknown ground is not safer.
const JOINT_DETOUR_MM: f64 = 500.0;
/// Distance between the places of the border that are tried, millimetres.
const JOINT_STEP_MM: f64 = 100.0;

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

fn nearest_on(ends: [Corner; 2], place: Corner) -> Corner {
    between(ends, foot_share(ends, place).clamp(0.0, 1.0))
}

/// What stands in free space is this large around each place where it was seen, millimetres.
const THING_MM: f64 = 30.0;
/// Two nodes saw the same when they saw it within this, millimetres.
const SEEN_TWICE_MM: f64 = 60.0;
/// What is nearer than this to an edge's line cannot be there, as the edge says, millimetres.
const EDGE_ROOM_MM: f64 = 110.0;
/// What is nearer than this to a rectangle's border is the wall behind it, millimetres.
const BORDER_MM: f64 = 50.0;

/// Whether a place lies inside a rectangle, well away from its border.
fn is_deep_inside(rectangle: &IntContour<i32>, place: Corner) -> bool {
    let [low, _, high, _] = rectangle.as_slice() else { return false };
    let is_between = |low: i32, high: i32, at: f64| at > f64::from(low) + BORDER_MM && at < f64::from(high) - BORDER_MM;
    is_between(low.x, high.x, place[0]) && is_between(low.y, high.y, place[1])
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
    let (dx, dy) = (f64::from(to.x_mm - from.x_mm), f64::from(to.y_mm - from.y_mm));
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
    let [at, a, b] = [at, a, b].map(|place| [f64::from(place.x_mm), f64::from(place.y_mm)]);
    distance(nearest_on([a, b], at), at) * 1e-3
}
