//! Where a robot's centre may be, as a mesh of triangles: the nodes' rectangles and the edges' corridors together, less the
//! robot's half width. Rectangles that overlap or touch are one space, and the way from one to the next is as wide as what
//! they share.
//!
//! Everything is counted in whole millimetres, so that robot and server get the same mesh of the same map.

use crate::approach::ApproachConfig;
use crate::contours::{corridor, octagon, rectangle, union};
use crate::mesh::Mesh;
use crate::plane::{Corner, corner_of, cross, fixed_point, from_segment_m};
use crate::seen_walls::SeenWalls;
use crate::state::MapState;
use crate::view::View;
use fht_proto::{EdgeKey, FixedPoint};
use i_overlay::core::fill_rule::FillRule;
use i_overlay::core::overlay::Overlay;
use i_overlay::core::overlay_rule::OverlayRule;
use i_overlay::i_float::int::angle::Angle;
use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::{IntContour, IntShapes};
use i_overlay::mesh::int::arc::ArcOptions;
use i_overlay::mesh::int::outline::offset::IntOutlineOffset;
use i_overlay::mesh::int::style::{IntLineJoin, IntOutlineStyle};
use i_triangle::int::triangulatable::IntTriangulatable;
use std::collections::BTreeSet;

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
            approach: ApproachConfig::default(),
        }
    }
}

/// Free space as a mesh.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    pub(crate) mesh: Mesh,
    /// Edges that something stands on.
    pub(crate) closed: BTreeSet<EdgeKey>,
    /// What the ways from places outside must keep away from.
    pub(crate) walls: SeenWalls,
    /// The ground that they had better lead over: what scanners saw, and rectangles, least and greatest corner.
    pub(crate) views: Vec<View>,
    pub(crate) rectangles: Vec<[Corner; 2]>,
    pub(crate) approach: ApproachConfig,
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
        let mesh = mesh_of(&free, config.half_width_mm);
        Self { mesh, closed, walls, views, rectangles: low_and_high, approach: config.approach.clone() }
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Whether a place lies in it: a robot's centre may be there.
    #[must_use]
    pub fn contains(&self, place: FixedPoint) -> bool {
        self.mesh.triangle_at(corner_of(place)).is_some()
    }
}

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

fn mesh_of(free: &IntShapes<i32>, half_width_mm: u16) -> Mesh {
    // Corners of walls are rounded by steps of 11.25°: at most 0.5 % nearer than asked for.
    let round = IntLineJoin::Round(ArcOptions { max_step: Angle::from_bits(1 << 27), ..ArcOptions::default() });
    let style = IntOutlineStyle::new(-i32::from(half_width_mm)).line_join(round);
    let Ok(shapes) = free.validate_outline(&style).and_then(|()| free.outline(&style)) else {
        return Mesh::default();
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
    Mesh::of(&corners, &triangles)
}
