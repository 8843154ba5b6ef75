//! Where a robot's centre may be, as a mesh of triangles: the nodes' rectangles and the edges'
//! corridors together, less the robot's half width. Rectangles that overlap or touch are one space,
//! and the way from one to the next is as wide as what they share.
//!
//! Everything is counted in whole millimetres, so that robot and server get the same mesh of the
//! same map.
//!
//! | module | idea |
//! | --- | --- |
//! | `contours` | rectangles, corridors and obstacles as outlines |
//! | `interior` | what lies well inside of all rectangles |
//! | `closed_ground` | what operators keep out, and barriers across edges that they closed |
//! | `visibility` | what a main node's scanner saw: ends of beams, and the ground below them |
//! | `seen_walls` | walls that a way into the mesh keeps away from |

pub(crate) mod closed_ground;
mod contours;
mod interior;
mod seen_walls;
pub(super) mod visibility;

use crate::crdt::state::MapState;
use crate::navmesh::cell_grid::Extent;
use crate::navmesh::entry_config::EntryConfig;
use crate::navmesh::limits::{Looks, OverBudget, SpaceLimits, check_overlaps, collect_outlines};
use crate::navmesh::mesh::Mesh;
use crate::navmesh::plane::{Corner, corner_of, cross, fixed_point, from_segment_m};
use closed_ground::{ClosedZone, barriers};
use contours::{corridor, difference, octagon, rectangle, union};
use fht_proto::{EdgeKey, FixedPoint, Footprint};
use i_overlay::i_float::int::angle::Angle;
use i_overlay::i_float::int::point::IntPoint;
use i_overlay::i_shape::int::shape::IntShapes;
use i_overlay::mesh::int::arc::ArcOptions;
use i_overlay::mesh::int::outline::offset::IntOutlineOffset;
use i_overlay::mesh::int::style::{IntLineJoin, IntOutlineStyle};
use i_triangle::int::triangulatable::IntTriangulatable;
use interior::Inner;
use seen_walls::SeenWalls;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use visibility::Visibility;

/// How free space is made of a map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SpaceConfig {
    /// The robot's centre keeps this far from the border of free space, millimetres. Default 160
    /// ([`Footprint::mesh_clearance_mm`]): the robot's 105, the 30 by which a corner may stand out
    /// of a wall's occupied cells, and 25 of which map and driving may be off.
    pub half_width_mm: u16,
    /// Half width of the corridor that an edge promises, millimetres. Default 165
    /// ([`Footprint::edge_clearance_mm`] of the explorers): little more than the half width, so
    /// that the way leads along the edge's line. Around that line 0.13 m are free and no more
    /// ([`Footprint::sure_clearance_mm`]), and corners that a wider corridor covers would be cut.
    /// For larger robots, which have no way along an edge's line alone, the corridor is no wider
    /// than those 0.13 m.
    pub corridor_mm: u16,
    /// Places where something stands that the map does not know. Default none.
    // The map and its robots say that, not a file; so below.
    #[serde(skip)]
    pub blocked: BTreeSet<FixedPoint>,
    /// It reaches this far around such a place, millimetres. Default 300.
    pub blocked_radius_mm: u16,
    /// Ground that operators keep robots out of: simple polygons, map frame, in either sense. What
    /// lies in them is no free space; a robot that stands in one may leave it, none is led into it.
    /// Fewer than three corners are none. Default none.
    #[serde(skip)]
    pub keep_out: Vec<Vec<FixedPoint>>,
    /// Edges that operators closed. Every passage that such an edge leads through is closed from
    /// wall to wall, also for ways over other edges and through rectangles that overlap there; in
    /// the open it loses its corridor only. Default none.
    #[serde(skip)]
    pub closed: BTreeSet<EdgeKey>,
    /// What is at most this wide across an edge is a passage, millimetres. Default 2500: a hallway,
    /// a wide door.
    pub passage_mm: u16,
    /// How places outside join it.
    pub approach: EntryConfig,
    /// Whether paths may lead over nodes and edges where the mesh has none. Default true. False for
    /// robots larger than the explorers: the explorers' own clearance is all that edges promise.
    pub is_edge_enough: bool,
    /// Maps beyond these get no mesh: paths are planned over their nodes.
    pub limits: SpaceLimits,
}

impl SpaceConfig {
    /// For robots of a footprint, as [`Footprint::planned_as`] rounds it; nothing is blocked or
    /// closed.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        let (planned, explorers) = (footprint.planned_as(), Footprint::default());
        let is_larger = planned.is_larger_than_explorers();
        Self {
            half_width_mm: planned.mesh_clearance_mm(),
            corridor_mm: if is_larger { explorers.sure_clearance_mm() } else { explorers.edge_clearance_mm() },
            blocked: BTreeSet::new(),
            blocked_radius_mm: 300,
            keep_out: Vec::new(),
            closed: BTreeSet::new(),
            passage_mm: 2500,
            approach: EntryConfig::of(&planned),
            is_edge_enough: !is_larger,
            limits: SpaceLimits::default(),
        }
    }
}

impl Default for SpaceConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

/// Free space as a mesh.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    pub(crate) mesh: Mesh,
    /// Edges that something stands on, or that operators closed.
    pub(crate) closed: BTreeSet<EdgeKey>,
    /// What no way may lead over: first what operators keep out, then what stands around blocked
    /// places, then barriers across closed edges.
    pub(crate) zones: Vec<ClosedZone>,
    keep_out_count: usize,
    blocked_count: usize,
    /// The same for ways into the mesh, over ground that no rectangle covers.
    screens: Vec<ClosedZone>,
    over_budget: Option<OverBudget>,
    /// What the ways from places outside must keep away from.
    pub(crate) walls: SeenWalls,
    /// The ground that they had better lead over: what scanners saw, and rectangles, least and
    /// greatest corner.
    pub(crate) views: Vec<Visibility>,
    pub(crate) rectangles: Vec<[Corner; 2]>,
    pub(crate) approach: EntryConfig,
    /// Whether paths may not lead over nodes and edges alone.
    pub(crate) is_mesh_needed: bool,
}

/// Where an edge's nodes stand, if both are shown.
fn ends_of(map: &MapState, edge: EdgeKey) -> Option<[FixedPoint; 2]> {
    let place = |id| map.node(id).map(|node| node.pose.position);
    Some([place(edge.low())?, place(edge.high())?])
}

/// The edges that make corridors.
fn short_edges(map: &MapState) -> impl Iterator<Item = [FixedPoint; 2]> + '_ {
    map.edges().filter_map(|edge| ends_of(map, edge)).filter(|[a, b]| a.distance(*b) <= LONGEST_EDGE_M)
}

impl FreeSpace {
    /// The free space of a map.
    #[must_use]
    pub fn of(map: &MapState, config: &SpaceConfig) -> Self {
        let keep_out: Vec<ClosedZone> = config.keep_out.iter().filter_map(|corners| ClosedZone::of(corners)).collect();
        let blocked: Vec<ClosedZone> = blocked_zones(config).collect();
        let (keep_out_count, blocked_count) = (keep_out.len(), blocked.len());
        let zones = [keep_out, blocked].concat();
        let made = Self::within_limits(map, config, zones.clone());
        let mut space = made.unwrap_or_else(|over_budget| Self {
            screens: zones.clone(),
            zones,
            over_budget: Some(over_budget),
            approach: config.approach.clone(),
            ..Self::default()
        });
        (space.keep_out_count, space.blocked_count) = (keep_out_count, blocked_count);
        space.is_mesh_needed = !config.is_edge_enough;
        space.closed = space.closed_edges(map, config);
        space
    }

    fn within_limits(map: &MapState, config: &SpaceConfig, mut zones: Vec<ClosedZone>) -> Result<Self, OverBudget> {
        let SpaceLimits { outlines: most_outlines, overlaps, beams, looks, corners } = config.limits;
        let rectangles = collect_outlines(map.nodes().filter_map(|node| rectangle(&node)), most_outlines)?;
        let as_corner = |it: IntPoint<i32>| [f64::from(it.x), f64::from(it.y)];
        let low_and_high: Vec<Extent> =
            rectangles.iter().filter_map(|it| Some([as_corner(*it.first()?), as_corner(*it.get(2)?)])).collect();
        let corridors = short_edges(map).filter_map(|[a, b]| corridor(a, b, config.corridor_mm));
        let outlines = collect_outlines(rectangles.into_iter().chain(corridors), most_outlines)?;
        check_overlaps(&outlines, overlaps)?;
        let mut views = Vec::new();
        let mut beam_count = 0;
        for view in map.main_nodes().filter_map(|node| Visibility::of(&node)) {
            beam_count += view.beams();
            if beam_count > beams {
                return Err(OverBudget::Beams(beams));
            }
            views.push(view);
        }
        let mut walls = SeenWalls::of(&views);
        let inner = Inner::of(&low_and_high);
        let is_inside = |place: Corner, looks: &mut Looks| inner.contains(place, looks);
        // What is nearer to an edge cannot be there, as the edge says.
        let edge_thing_mm = f64::from(Footprint::default().edge_thing_mm());
        let lines = short_edges(map).map(|ends| ends.map(corner_of));
        let things = walls.things(&views, is_inside, lines, edge_thing_mm, &mut Looks::new(looks))?;
        walls.thin_out();
        let mut free = union(outlines);
        check_corners(&free, corners)?;
        let mut screens = zones.clone();
        for ends in config.closed.iter().filter_map(|edge| ends_of(map, *edge)) {
            if ends[0].distance(ends[1]) <= LONGEST_EDGE_M {
                for [barrier, screen] in barriers(&free, ends, config.corridor_mm.into(), config.passage_mm.into()) {
                    zones.push(barrier);
                    screens.push(screen);
                }
            }
        }
        let things = things.into_iter().map(|place| octagon(fixed_point(place), THING_MM).collect());
        // Each by itself first, and all in one sense: where two overlap, neither must open what the
        // other closes.
        let closed = zones.iter().flat_map(|zone| union(vec![zone.outline()]));
        let closed = closed.filter_map(|shape| shape.into_iter().next());
        let obstacles = collect_outlines(things.chain(closed), most_outlines)?;
        check_overlaps(&obstacles, overlaps)?;
        if !obstacles.is_empty() {
            free = difference(&free, &union(obstacles));
        }
        check_corners(&free, corners)?;
        let mesh = mesh_of(&free, config.half_width_mm);
        let approach = config.approach.clone();
        Ok(Self { mesh, walls, views, rectangles: low_and_high, zones, screens, approach, ..Self::default() })
    }

    /// Edges that no way may lead over, if one is planned over nodes.
    fn closed_edges(&self, map: &MapState, config: &SpaceConfig) -> BTreeSet<EdgeKey> {
        if config.blocked.is_empty() && self.zones.is_empty() {
            return config.closed.clone();
        }
        let reach_m = (f64::from(config.blocked_radius_mm) + f64::from(config.half_width_mm)) * 1e-3;
        let is_blocked = |[a, b]: [FixedPoint; 2]| {
            config.blocked.iter().any(|at| from_segment_m(*at, a, b) < reach_m)
                || self.zones.iter().any(|zone| zone.is_met([a, b].map(corner_of)))
        };
        let blocked = map.edges().filter(|edge| ends_of(map, *edge).is_some_and(is_blocked));
        blocked.chain(config.closed.iter().copied()).collect()
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Why there is no mesh, if the map is beyond [`SpaceConfig::limits`]: paths then lead over
    /// nodes and edges.
    #[must_use]
    pub fn over_budget(&self) -> Option<OverBudget> {
        self.over_budget
    }

    /// Whether a place lies in it: a robot's centre may be there.
    #[must_use]
    pub fn contains(&self, place: FixedPoint) -> bool {
        self.mesh.triangle_at(corner_of(place)).is_some()
    }

    /// Whether operators keep robots out of a place.
    #[must_use]
    pub fn is_kept_out(&self, place: FixedPoint) -> bool {
        self.zones[..self.keep_out_count].iter().any(|zone| zone.covers(corner_of(place)))
    }

    /// Whether no path may end at a place: operators keep robots out, or a robot has reported that
    /// something stands there.
    pub(crate) fn is_closed_goal(&self, place: FixedPoint) -> bool {
        let closed = &self.zones[..self.keep_out_count + self.blocked_count];
        closed.iter().any(|zone| zone.covers(corner_of(place)))
    }

    /// What may not be crossed on a way from a place. What it lies in itself may be left.
    pub(crate) fn screens_around(&self, place: Corner, reach_mm: f64) -> impl Iterator<Item = &ClosedZone> {
        self.screens.iter().filter(move |zone| zone.is_within(place, reach_mm) && !zone.covers(place))
    }
}

/// What stands around blocked places.
fn blocked_zones(config: &SpaceConfig) -> impl Iterator<Item = ClosedZone> + '_ {
    let outline = |at: &FixedPoint| -> Vec<FixedPoint> {
        octagon(*at, f64::from(config.blocked_radius_mm)).map(|it| FixedPoint { x_mm: it.x, y_mm: it.y }).collect()
    };
    config.blocked.iter().filter_map(move |at| ClosedZone::of(&outline(at)))
}

fn check_corners(shapes: &IntShapes<i32>, most: usize) -> Result<(), OverBudget> {
    let count: usize = shapes.iter().flatten().map(Vec::len).sum();
    if count > most { Err(OverBudget::Corners(most)) } else { Ok(()) }
}

/// Edges that are longer make no corridors, metres: no explorer sees so far, and a corridor costs
/// by its length.
const LONGEST_EDGE_M: f64 = 100.0;
/// What stands in free space is this large around each place where it was seen, millimetres.
const THING_MM: f64 = 30.0;

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
