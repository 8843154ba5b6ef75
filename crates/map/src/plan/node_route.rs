//! A path between two places over nodes and edges: the paper's path planning (section III-C-2,
//! equation 11), over all start and goal nodes at once.
//!
//! A place joins the graph through every node whose rectangle of free space contains it, at the
//! straight distance. If no rectangle contains it, it joins through the nodes near it, and the way
//! to their rectangles, of which the map knows nothing, counts [`NodeRouteConfig::unmapped_factor`]
//! times (the paper's `k ≫ 1`). The paper multiplies the whole way to the node; here the part
//! inside the rectangle, known to be free, counts once, and the path enters the rectangle at its
//! nearest point. For a node without a rectangle both are the same.

use crate::crdt::state::MapState;
use crate::graph::astar::{Exceptions, Workspace, shortest_way};
use crate::graph::dijkstra::{distance_um, steps_from, to_um};
use crate::index::map_index::MapIndex;
use crate::index::spatial::nearest_in;
use fht_proto::{EdgeKey, FixedPoint, NodeId, Rect};
use pathfinding::directed::dijkstra::dijkstra;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// How paths are planned.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct NodeRouteConfig {
    /// How many metres of mapped way a metre of unmapped way counts for (the paper's k). Default
    /// 10.
    pub unmapped_factor: f64,
    /// A place farther than this from all rectangles and nodes is out of the map, metres. Default
    /// 2.
    pub max_detour_m: f64,
    /// Edges that must not be used: a robot that found the way blocked plans round it. Default
    /// none.
    // The map and its robots say that, not a file.
    #[serde(skip)]
    pub blocked: BTreeSet<EdgeKey>,
    /// What is known of the two places. Default: nothing.
    // Who asks says that.
    #[serde(skip)]
    pub ends: PathEnds,
}

/// What is known of the two places that a path is to join, and what becomes of a goal that cannot
/// be reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathEnds {
    /// A robot stands at the start. Nobody knows whether the goal can be reached: if free space
    /// does not reach it, or only through a wall that a main node saw, there is no path.
    #[default]
    Unknown,
    /// The same, but to a goal that cannot be reached the path leads as near as free space does.
    ToNearest,
    /// Robots were at both places, such as nodes: each is joined to free space as well as can be.
    Known,
}

impl Default for NodeRouteConfig {
    fn default() -> Self {
        Self { unmapped_factor: 10.0, max_detour_m: 2.0, blocked: BTreeSet::new(), ends: PathEnds::Unknown }
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
pub struct NodeRoute {
    /// Length over all waypoints, metres.
    pub length_m: f64,
    /// From start to goal, both included; consecutive points differ.
    pub waypoints: Vec<RoutePoint>,
    /// How much of it leads over ground that the map knows nothing of: no rectangle covers it, and
    /// no main node saw it. Metres.
    pub unmapped_m: f64,
    /// How far the last point is from the goal that was asked for, metres; 0 but for
    /// [`PathEnds::ToNearest`].
    pub goal_moved_m: f64,
}

/// Why there is no route.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RouteError {
    /// Nothing joins the two places.
    #[error(
        "no path joins ({:.2}, {:.2}) and ({:.2}, {:.2}){}{}",
        from.x(), from.y(), to.x(), to.y(), how_near(*nearest, *to), if *is_shut_in { SHUT_IN } else { "" }
    )]
    NoPath {
        /// The start.
        from: FixedPoint,
        /// The goal.
        to: FixedPoint,
        /// Where free space that can be reached is nearest to the goal; none if that is unknown.
        nearest: Option<FixedPoint>,
        /// Whether nothing leads away from the start.
        is_shut_in: bool,
    },
    /// A place is not in the mapped space, and not near it either.
    #[error("({:.2}, {:.2}) is not on the map: {}", point.x(), point.y(), how_far(*nearest_m, *max_detour_m, *is_goal))]
    OutOfMap {
        /// The place.
        point: FixedPoint,
        /// How far the nearest rectangle or node is, metres; none if the map has no nodes.
        nearest_m: Option<f64>,
        /// [`NodeRouteConfig::max_detour_m`].
        max_detour_m: f64,
        /// Whether it is the goal.
        is_goal: bool,
    },
}

impl RouteError {
    /// That nothing joins two places, as far as is known.
    pub(crate) fn no_path(from: FixedPoint, to: FixedPoint) -> Self {
        Self::NoPath { from, to, nearest: None, is_shut_in: false }
    }
}

/// What is wrong with a start from which nothing leads away.
const SHUT_IN: &str = "; nothing leads away from the start, as far as the map knows";

fn how_near(nearest: Option<FixedPoint>, goal: FixedPoint) -> String {
    let near = |at: FixedPoint| {
        let away_m = at.distance(goal);
        let (x, y) = (at.x(), at.y());
        format!(
            "; the nearest point that can be reached is ({x:.2}, {y:.2}), {away_m:.2} m from the goal: to_nearest=true \
             asks for the path there"
        )
    };
    nearest.map(near).unwrap_or_default()
}

fn how_far(nearest_m: Option<f64>, max_detour_m: f64, is_goal: bool) -> String {
    let hint =
        if is_goal { "; to_nearest=true asks for the path to the nearest point that can be reached" } else { "" };
    match nearest_m {
        Some(nearest_m) => {
            format!(
                "the nearest free space or node is {nearest_m:.1} m away, and {max_detour_m:.1} m are bridged{hint}"
            )
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

/// Nodes near a place with their positions and rectangles; if there are none, how far the nearest
/// is, metres.
pub type Near<Node> = Result<Vec<(Node, FixedPoint, Rect)>, Option<f64>>;

/// What a route over nodes is planned on: a map as it is, or the index of a large one
/// ([`IndexedGraph`]), which is faster. Of routes that are equally long they may find different
/// ones.
pub trait RouteGraph {
    /// How its nodes are named.
    type Node: Copy + Ord;

    /// The nodes whose rectangles come within `reach_m` metres of a place, with their positions and
    /// rectangles. If there are none: how far the nearest is, metres.
    ///
    /// # Errors
    /// There are none.
    fn near(&self, point: FixedPoint, reach_m: f64) -> Near<Self::Node>;

    /// The nodes of the shortest way from any of `starts` to any of `goals`, each of which counts
    /// some micrometres itself.
    fn way(
        &mut self,
        starts: &[(Self::Node, u64)],
        goals: &[(Self::Node, u64)],
        blocked: &BTreeSet<EdgeKey>,
    ) -> Option<Vec<Self::Node>>;

    /// A node as a point of a route.
    fn point(&self, node: Self::Node) -> Option<RoutePoint>;
}

/// A vertex of the search: the graph's nodes and the two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Vertex {
    Start,
    Node(NodeId),
    Goal,
}

impl RouteGraph for &MapState {
    type Node = NodeId;

    fn near(&self, point: FixedPoint, reach_m: f64) -> Near<NodeId> {
        let all = self.nodes().map(|node| {
            let (position, rect) = (node.pose.position, node.free_space.unwrap_or_default());
            (nearest_in(position, rect, point).distance(point), (node.id, position, rect))
        });
        let all: Vec<(f64, (NodeId, FixedPoint, Rect))> = all.collect();
        let nearest_m = all.iter().map(|(away_m, _)| *away_m).min_by(f64::total_cmp);
        let near: Vec<_> = all.into_iter().filter(|(away_m, _)| *away_m <= reach_m).map(|(_, node)| node).collect();
        if near.is_empty() { Err(nearest_m) } else { Ok(near) }
    }

    fn way(
        &mut self,
        starts: &[(NodeId, u64)],
        goals: &[(NodeId, u64)],
        blocked: &BTreeSet<EdgeKey>,
    ) -> Option<Vec<NodeId>> {
        let goals: BTreeMap<NodeId, u64> = goals.iter().copied().collect();
        let steps = |vertex: &Vertex| -> Vec<(Vertex, u64)> {
            match vertex {
                Vertex::Start => starts.iter().map(|&(id, cost_um)| (Vertex::Node(id), cost_um)).collect(),
                Vertex::Node(id) => {
                    let goal = goals.get(id).map(|cost_um| (Vertex::Goal, *cost_um));
                    let nodes = steps_from(self, *id, blocked).map(|(id, length_um)| (Vertex::Node(id), length_um));
                    nodes.chain(goal).collect()
                }
                Vertex::Goal => Vec::new(),
            }
        };
        let (vertices, _) = dijkstra(&Vertex::Start, steps, |vertex| *vertex == Vertex::Goal)?;
        let node = |vertex: &Vertex| if let Vertex::Node(id) = vertex { Some(*id) } else { None };
        Some(vertices.iter().filter_map(node).collect())
    }

    fn point(&self, node: NodeId) -> Option<RoutePoint> {
        self.node(node).map(|node| RoutePoint { point: node.pose.position, node: Some(node.id) })
    }
}

/// The index of a map, and what searches over it write down.
#[derive(Debug)]
pub struct IndexedGraph<'a> {
    /// The index.
    pub index: &'a MapIndex,
    /// Kept from one search to the next.
    pub work: &'a mut Workspace,
}

impl RouteGraph for IndexedGraph<'_> {
    type Node = u32;

    fn near(&self, point: FixedPoint, reach_m: f64) -> Near<u32> {
        let places = self.index.places();
        let numbers = places.within(point, reach_m).into_iter();
        let near: Vec<_> =
            numbers.filter_map(|number| places.get(number).map(|(position, rect)| (number, position, rect))).collect();
        if near.is_empty() { Err(places.nearest_m(point)) } else { Ok(near) }
    }

    fn way(&mut self, starts: &[(u32, u64)], goals: &[(u32, u64)], blocked: &BTreeSet<EdgeKey>) -> Option<Vec<u32>> {
        let roads = self.index.roads();
        let closed = |edge: &EdgeKey| Some((roads.number(edge.low())?, roads.number(edge.high())?, None));
        let closed = Exceptions::new(blocked.iter().filter_map(closed));
        shortest_way(roads, Some(self.index.guide()), starts, goals, &closed, self.work).map(|way| way.nodes)
    }

    fn point(&self, node: u32) -> Option<RoutePoint> {
        let roads = self.index.roads();
        roads.position(node).map(|point| RoutePoint { point, node: roads.id(node) })
    }
}

/// How `point` joins a node at `position` by the nearest point of its rectangle.
fn access(position: FixedPoint, rect: Rect, point: FixedPoint, config: &NodeRouteConfig) -> Access {
    let entry = nearest_in(position, rect, point);
    let unmapped_um = to_um(entry.distance(point) * config.unmapped_factor.max(1.0));
    let cost_um = unmapped_um.saturating_add(distance_um(entry, position));
    Access { cost_um, entry: (entry != point).then_some(entry) }
}

/// The ways to join `point` to the graph, by node: those inside the nodes' rectangles if there are
/// any, else all.
fn accesses<G: RouteGraph>(
    graph: &G,
    point: FixedPoint,
    is_goal: bool,
    config: &NodeRouteConfig,
) -> Result<BTreeMap<G::Node, Access>, RouteError> {
    let max_detour_m = config.max_detour_m;
    let near = graph.near(point, max_detour_m);
    let near = near.map_err(|nearest_m| RouteError::OutOfMap { point, nearest_m, max_detour_m, is_goal })?;
    let all: BTreeMap<G::Node, Access> =
        near.into_iter().map(|(node, position, rect)| (node, access(position, rect, point, config))).collect();
    let is_inside = all.values().any(|access| access.entry.is_none());
    Ok(all.into_iter().filter(|(_, access)| !is_inside || access.entry.is_none()).collect())
}

/// Whether a path could end at a place: that it is on the map, or near it. Whether anything leads
/// there, only planning tells.
///
/// # Errors
/// [`RouteError::OutOfMap`].
pub fn check_goal(graph: impl RouteGraph, goal: FixedPoint, config: &NodeRouteConfig) -> Result<(), RouteError> {
    accesses(&graph, goal, true, config).map(drop)
}

/// Whether one rectangle contains both places: rectangles are convex, so the way is straight.
fn share_rectangle<Id: Ord>(starts: &BTreeMap<Id, Access>, goals: &BTreeMap<Id, Access>) -> bool {
    let is_inside = |access: &Access| access.entry.is_none();
    starts.iter().any(|(id, start)| is_inside(start) && goals.get(id).is_some_and(is_inside))
}

/// Plans from `from` to `to` (map frame).
///
/// # Errors
/// [`RouteError::OutOfMap`] for a place too far from the mapped space, [`RouteError::NoPath`] if
/// nothing joins the two.
pub fn plan<G: RouteGraph>(
    mut graph: G,
    from: FixedPoint,
    to: FixedPoint,
    config: &NodeRouteConfig,
) -> Result<NodeRoute, RouteError> {
    let (starts, goals) = (accesses(&graph, from, false, config)?, accesses(&graph, to, true, config)?);
    if share_rectangle(&starts, &goals) {
        return Ok(route_over([plain(from), plain(to)]));
    }
    let costs = |accesses: &BTreeMap<G::Node, Access>| -> Vec<(G::Node, u64)> {
        accesses.iter().map(|(node, access)| (*node, access.cost_um)).collect()
    };
    let nodes = graph.way(&costs(&starts), &costs(&goals), &config.blocked).ok_or(RouteError::no_path(from, to))?;
    let entry = |accesses: &BTreeMap<G::Node, Access>, node: Option<&G::Node>| {
        node.and_then(|node| accesses.get(node)).and_then(|access| access.entry).map(plain)
    };
    let points = std::iter::once(plain(from))
        .chain(entry(&starts, nodes.first()))
        .chain(nodes.iter().filter_map(|&node| graph.point(node)))
        .chain(entry(&goals, nodes.last()))
        .chain(std::iter::once(plain(to)));
    let unmapped_m = |accesses: &BTreeMap<G::Node, Access>, node: Option<&G::Node>, place: FixedPoint| {
        let entry = node.and_then(|node| accesses.get(node)).and_then(|access| access.entry);
        entry.map_or(0.0, |entry| entry.distance(place))
    };
    let unmapped_m = unmapped_m(&starts, nodes.first(), from) + unmapped_m(&goals, nodes.last(), to);
    Ok(NodeRoute { unmapped_m, ..route_over(points) })
}

/// Plans from one node to another over edges that are not blocked.
///
/// # Errors
/// [`RouteError::NoPath`] if nothing joins the two.
pub fn plan_between<G: RouteGraph>(
    mut graph: G,
    [from, to]: [G::Node; 2],
    blocked: &BTreeSet<EdgeKey>,
) -> Result<NodeRoute, RouteError> {
    let place = |graph: &G, node| graph.point(node).map(|at| at.point).unwrap_or_default();
    let no_path = RouteError::no_path(place(&graph, from), place(&graph, to));
    let nodes = graph.way(&[(from, 0)], &[(to, 0)], blocked).ok_or(no_path)?;
    Ok(route_over(nodes.into_iter().filter_map(|node| graph.point(node))))
}

fn plain(point: FixedPoint) -> RoutePoint {
    RoutePoint { point, node: None }
}

/// The route over `points`; of points at one place, one that is a node stays.
fn route_over(points: impl IntoIterator<Item = RoutePoint>) -> NodeRoute {
    let mut waypoints: Vec<RoutePoint> = Vec::new();
    for point in points {
        match waypoints.last_mut() {
            Some(last) if last.point == point.point => last.node = last.node.or(point.node),
            _ => waypoints.push(point),
        }
    }
    // The sum of nothing is -0.0.
    let length_m = 0.0 + waypoints.windows(2).map(|pair| pair[0].point.distance(pair[1].point)).sum::<f64>();
    NodeRoute { length_m, waypoints, unmapped_m: 0.0, goal_moved_m: 0.0 }
}
