//! A path between two places: the paper's equation 5 over all start and goal nodes at once.
//!
//! A place joins the graph through every node whose rectangle of free space contains it, at the straight distance. If no
//! rectangle contains it, it joins through the nodes near it, and the way to their rectangles, of which the map knows
//! nothing, counts [`RouteConfig::unmapped_factor`] times (the paper's `k ≫ 1`). The paper multiplies the whole way to the
//! node; here the part inside the rectangle, known to be free, counts once, and the path enters the rectangle at its
//! nearest point. For a node without a rectangle both are the same.

use crate::graph::{distance_um, steps_from, to_um};
use crate::map_index::MapIndex;
use crate::places::nearest_in;
use crate::shortest::{Exceptions, Workspace, shortest_way};
use crate::state::MapState;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use pathfinding::directed::dijkstra::dijkstra;
use std::collections::{BTreeMap, BTreeSet};

/// How paths are planned.
#[derive(Clone, Debug)]
pub struct RouteConfig {
    /// How many metres of mapped way a metre of unmapped way counts for (the paper's k). Default 10.
    pub unmapped_factor: f64,
    /// A place farther than this from all rectangles and nodes is out of the map, metres. Default 2.
    pub max_detour_m: f64,
    /// Edges that must not be used: a robot that found the way blocked plans round it. Default none.
    pub blocked: BTreeSet<EdgeKey>,
}

impl Default for RouteConfig {
    fn default() -> Self {
        Self { unmapped_factor: 10.0, max_detour_m: 2.0, blocked: BTreeSet::new() }
    }
}

/// A point of a route.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RoutePoint {
    /// Where, in the map frame.
    pub point: FixedPoint,
    /// The node there; none at the start, at the goal and where a rectangle is entered or left.
    pub node: Option<NodeId>,
}

/// A path from start to goal.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// Length over all waypoints, metres.
    pub length_m: f64,
    /// From start to goal, both included; consecutive points differ.
    pub waypoints: Vec<RoutePoint>,
}

/// Why there is no route.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RouteError {
    /// Nothing joins the two places.
    #[error("no path joins ({:.2}, {:.2}) and ({:.2}, {:.2})", from.x(), from.y(), to.x(), to.y())]
    NoPath {
        /// The start.
        from: FixedPoint,
        /// The goal.
        to: FixedPoint,
    },
    /// A place is not in the mapped space, and not near it either.
    #[error("({:.2}, {:.2}) is not on the map: {}", point.x(), point.y(), how_far(*nearest_m, *max_detour_m))]
    OutOfMap {
        /// The place.
        point: FixedPoint,
        /// How far the nearest rectangle or node is, metres; none if the map has no nodes.
        nearest_m: Option<f64>,
        /// [`RouteConfig::max_detour_m`].
        max_detour_m: f64,
    },
}

fn how_far(nearest_m: Option<f64>, max_detour_m: f64) -> String {
    match nearest_m {
        Some(nearest_m) => {
            format!("the nearest mapped free space is {nearest_m:.1} m away, and {max_detour_m:.1} m are bridged")
        }
        None => "it has no nodes".to_owned(),
    }
}

/// How a place joins the graph through one node.
#[derive(Clone, Copy, Debug)]
struct Access {
    /// Weighted length of the way between place and node, micrometres.
    cost_um: u64,
    /// Where the way enters the node's rectangle; `None` if the place lies in it.
    entry: Option<FixedPoint>,
}

/// A vertex of the search: the graph's nodes and the two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Vertex {
    Start,
    Node(NodeId),
    Goal,
}

/// How `point` joins a node at `position` by the nearest point of its rectangle, and how far that is from it, metres.
fn access(position: FixedPoint, entry: FixedPoint, point: FixedPoint, config: &RouteConfig) -> Access {
    let unmapped_um = to_um(entry.distance(point) * config.unmapped_factor.max(1.0));
    let cost_um = unmapped_um.saturating_add(distance_um(entry, position));
    Access { cost_um, entry: (entry != point).then_some(entry) }
}

/// Of ways to join a place, by node: those inside the nodes' rectangles if there are any, else all.
fn inside_first<Id: Ord>(all: BTreeMap<Id, Access>) -> BTreeMap<Id, Access> {
    let is_inside = all.values().any(|access| access.entry.is_none());
    all.into_iter().filter(|(_, access)| !is_inside || access.entry.is_none()).collect()
}

/// All ways to join `point` to the graph, by node.
fn accesses(map: &MapState, point: FixedPoint, config: &RouteConfig) -> Result<BTreeMap<NodeId, Access>, RouteError> {
    let near = map.nodes().map(|node| {
        let position = node.pose.position;
        let entry = nearest_in(position, node.free_space.unwrap_or_default(), point);
        (node.id, position, entry, entry.distance(point))
    });
    let near: Vec<_> = near.collect();
    let nearest_m = near.iter().map(|(.., away_m)| *away_m).min_by(f64::total_cmp);
    let reached = near.into_iter().filter(|(.., away_m)| *away_m <= config.max_detour_m);
    let all: BTreeMap<NodeId, Access> =
        reached.map(|(id, position, entry, _)| (id, access(position, entry, point, config))).collect();
    if all.is_empty() {
        return Err(RouteError::OutOfMap { point, nearest_m, max_detour_m: config.max_detour_m });
    }
    Ok(inside_first(all))
}

/// All ways to join `point` to the graph, by the number of the node.
fn accesses_over(
    index: &MapIndex,
    point: FixedPoint,
    config: &RouteConfig,
) -> Result<BTreeMap<u32, Access>, RouteError> {
    let places = index.places();
    let near = places.within(point, config.max_detour_m).into_iter();
    let all: BTreeMap<u32, Access> = near
        .filter_map(|number| {
            let (position, rect) = places.get(number)?;
            Some((number, access(position, nearest_in(position, rect, point), point, config)))
        })
        .collect();
    if all.is_empty() {
        let (nearest_m, max_detour_m) = (places.nearest_m(point), config.max_detour_m);
        return Err(RouteError::OutOfMap { point, nearest_m, max_detour_m });
    }
    Ok(inside_first(all))
}

/// Whether one rectangle contains both places: rectangles are convex, so the way is straight.
fn share_rectangle<Id: Ord>(starts: &BTreeMap<Id, Access>, goals: &BTreeMap<Id, Access>) -> bool {
    let is_inside = |access: &Access| access.entry.is_none();
    starts.iter().any(|(id, start)| is_inside(start) && goals.get(id).is_some_and(is_inside))
}

/// Plans as [`plan`] does, over the map's index: fast on a large map. Of routes that are equally long it may find
/// another one.
///
/// # Errors
/// As [`plan`].
pub fn plan_over(
    index: &MapIndex,
    from: FixedPoint,
    to: FixedPoint,
    config: &RouteConfig,
    work: &mut Workspace,
) -> Result<Route, RouteError> {
    let (starts, goals) = (accesses_over(index, from, config)?, accesses_over(index, to, config)?);
    if share_rectangle(&starts, &goals) {
        return Ok(route_over([plain(from), plain(to)]));
    }
    let roads = index.roads();
    let closed = |edge: &EdgeKey| Some((roads.number(edge.low())?, roads.number(edge.high())?, None));
    let closed = Exceptions::new(config.blocked.iter().filter_map(closed));
    let costs = |accesses: &BTreeMap<u32, Access>| -> Vec<(u32, u64)> {
        accesses.iter().map(|(number, access)| (*number, access.cost_um)).collect()
    };
    let (start_costs, goal_costs) = (costs(&starts), costs(&goals));
    let way = shortest_way(roads, Some(index.guide()), &start_costs, &goal_costs, &closed, work);
    let nodes = way.ok_or(RouteError::NoPath { from, to })?.nodes;
    let entry = |accesses: &BTreeMap<u32, Access>, number: Option<&u32>| {
        number.and_then(|number| accesses.get(number)).and_then(|access| access.entry).map(plain)
    };
    let over = nodes.iter().filter_map(|&number| {
        let (point, node) = (roads.position(number)?, roads.id(number));
        Some(RoutePoint { point, node })
    });
    let points = std::iter::once(plain(from))
        .chain(entry(&starts, nodes.first()))
        .chain(over)
        .chain(entry(&goals, nodes.last()))
        .chain(std::iter::once(plain(to)));
    Ok(route_over(points))
}

/// Plans from `from` to `to` (map frame).
///
/// # Errors
/// [`RouteError::OutOfMap`] for a place too far from the mapped space, [`RouteError::NoPath`] if nothing joins the two.
pub fn plan(map: &MapState, from: FixedPoint, to: FixedPoint, config: &RouteConfig) -> Result<Route, RouteError> {
    let starts = accesses(map, from, config)?;
    let goals = accesses(map, to, config)?;
    if share_rectangle(&starts, &goals) {
        return Ok(route_over([plain(from), plain(to)]));
    }
    let steps = |vertex: &Vertex| -> Vec<(Vertex, u64)> {
        match vertex {
            Vertex::Start => starts.iter().map(|(&id, start)| (Vertex::Node(id), start.cost_um)).collect(),
            Vertex::Node(id) => {
                let goal = goals.get(id).map(|goal| (Vertex::Goal, goal.cost_um));
                let nodes = steps_from(map, *id, &config.blocked).map(|(id, length)| (Vertex::Node(id), length));
                nodes.chain(goal).collect()
            }
            Vertex::Goal => Vec::new(),
        }
    };
    let (vertices, _) =
        dijkstra(&Vertex::Start, steps, |vertex| *vertex == Vertex::Goal).ok_or(RouteError::NoPath { from, to })?;
    let nodes: Vec<NodeId> =
        vertices.iter().filter_map(|vertex| if let Vertex::Node(id) = vertex { Some(*id) } else { None }).collect();
    let entry = |accesses: &BTreeMap<NodeId, Access>, id: Option<&NodeId>| {
        id.and_then(|id| accesses.get(id)).and_then(|access| access.entry).map(plain)
    };
    let over = nodes.iter().filter_map(|&id| {
        let node = map.node(id)?;
        Some(RoutePoint { point: node.pose.position, node: Some(id) })
    });
    let points = std::iter::once(plain(from))
        .chain(entry(&starts, nodes.first()))
        .chain(over)
        .chain(entry(&goals, nodes.last()))
        .chain(std::iter::once(plain(to)));
    Ok(route_over(points))
}

fn plain(point: FixedPoint) -> RoutePoint {
    RoutePoint { point, node: None }
}

/// The route over `points`; of points at one place, one that is a node stays.
fn route_over(points: impl IntoIterator<Item = RoutePoint>) -> Route {
    let mut waypoints: Vec<RoutePoint> = Vec::new();
    for point in points {
        match waypoints.last_mut() {
            Some(last) if last.point == point.point => last.node = last.node.or(point.node),
            _ => waypoints.push(point),
        }
    }
    let length_m = waypoints.windows(2).map(|pair| pair[0].point.distance(pair[1].point)).sum();
    Route { length_m, waypoints }
}
