//! The shortest path between two places through all the free space that the map knows: the node
//! path of the paper's equation 11, drawn taut through rectangles and corridors, and of all such
//! paths the shortest.

use crate::navmesh::free_space::FreeSpace;
use crate::navmesh::free_space::closed_ground::ClosedZone;
use crate::navmesh::mesh::Spot;
use crate::navmesh::outside::{MeshEntry, PathEnd};
use crate::navmesh::plane::{Corner, corner_of, distance, fixed_point};
use crate::navmesh::polyanya::shortest_way;
use crate::plan::node_route::{self, NodeRoute, NodeRouteConfig, PathEnds, RouteError, RouteGraph, RoutePoint};
use fht_proto::FixedPoint;

/// Ways into the mesh that are tried for places outside of it: through this many of its parts.
const PARTS: usize = 4;

/// Plans from `from` to `to` (map frame) through `space`, which must be that of `map`. A place
/// outside of it joins it over ground that no rectangle covers, and the way there counts
/// [`NodeRouteConfig::unmapped_factor`] times; no such way leads to a goal through a wall that a
/// main node saw. Of a map without a mesh ([`FreeSpace::over_budget`]) the path leads over nodes
/// and edges, and nobody looks at walls. For a robot larger than the explorers it leads through the
/// mesh, or there is none ([`SpaceConfig::is_edge_enough`](crate::SpaceConfig::is_edge_enough)).
///
/// # Errors
/// [`RouteError::OutOfMap`] for a place too far from the mapped space, [`RouteError::NoPath`] if
/// nothing joins the two.
pub fn plan(
    graph: impl RouteGraph,
    space: &FreeSpace,
    from: FixedPoint,
    to: FixedPoint,
    config: &NodeRouteConfig,
) -> Result<NodeRoute, RouteError> {
    let ways = Ways::of(space, from, to, config);
    if let Some(route) = ways.shortest() {
        return Ok(route);
    }
    // The mesh has holes where nodes have no rectangles and edges no room; of an enormous map there
    // is none.
    let refusal = match plan_over_nodes(graph, space, from, to, config) {
        Ok(route) => return Ok(route),
        Err(refusal) => refusal,
    };
    let is_goal_far = matches!(refusal, RouteError::OutOfMap { is_goal: true, .. });
    let ways = match refusal {
        RouteError::NoPath { .. } if ways.starts.is_empty() => ways.with_far_entries(),
        _ => ways,
    };
    match (refusal, config.ends) {
        (RouteError::NoPath { .. }, _) => {
            if let Some(route) = ways.shortest() {
                return Ok(route);
            }
        }
        (_, PathEnds::ToNearest) if is_goal_far => {}
        _ => return Err(refusal),
    }
    let spot = ways.nearest();
    if config.ends == PathEnds::ToNearest {
        // If there is none, nothing leads away from the start.
        return spot.and_then(|spot| ways.shortest_to_spot(spot)).ok_or_else(|| ways.no_path(None));
    }
    Err(ways.no_path(spot))
}

/// Plans over nodes and edges alone (the paper's equation 11), around what is closed in `space`,
/// which must be that of `map`. For a robot larger than the explorers there is no such path: edges
/// promise the explorers' clearance and no more.
///
/// # Errors
/// [`RouteError::OutOfMap`] for a place too far from the mapped space, [`RouteError::NoPath`] if
/// nothing joins the two.
pub fn plan_over_nodes(
    graph: impl RouteGraph,
    space: &FreeSpace,
    from: FixedPoint,
    to: FixedPoint,
    config: &NodeRouteConfig,
) -> Result<NodeRoute, RouteError> {
    let no_path = RouteError::no_path(from, to);
    if is_closed_goal(space, to, config) {
        return Err(no_path);
    }
    let blocked = config.blocked.union(&space.closed).copied().collect();
    match node_route::plan(graph, from, to, &NodeRouteConfig { blocked, ..config.clone() }) {
        // A way over nodes all of whose legs lie in the mesh would be found in it; the nodes only
        // say whether both places are on the map at all.
        Ok(_) if space.is_mesh_needed => Err(no_path),
        route => checked(space, route?, config).ok_or(no_path),
    }
}

/// Plans from one node to another over nodes and edges alone, in the same way.
///
/// # Errors
/// [`RouteError::NoPath`] if nothing joins the two.
pub fn plan_between_nodes<G: RouteGraph>(
    graph: G,
    space: &FreeSpace,
    ends: [G::Node; 2],
) -> Result<NodeRoute, RouteError> {
    let route = node_route::plan_between(graph, ends, &space.closed)?;
    let (from, to) = (route.waypoints.first(), route.waypoints.last());
    let [from, to] = [from, to].map(|end| end.map(|end| end.point).unwrap_or_default());
    let is_refused = space.is_mesh_needed || space.is_closed_goal(to);
    if is_refused { Err(RouteError::no_path(from, to)) } else { Ok(route) }
}

/// How two places can be joined through the mesh.
struct Ways<'a> {
    space: &'a FreeSpace,
    config: &'a NodeRouteConfig,
    from: FixedPoint,
    to: FixedPoint,
    starts: Vec<MeshEntry>,
}

impl<'a> Ways<'a> {
    fn of(space: &'a FreeSpace, from: FixedPoint, to: FixedPoint, config: &'a NodeRouteConfig) -> Self {
        let start = if config.ends == PathEnds::Known { PathEnd::Known } else { PathEnd::Start };
        let starts = space.approaches(from, config.max_detour_m * 1000.0, start);
        Self { space, config, from, to, starts }
    }

    /// With ways into the mesh of twice the length: a node is near, but not in sight.
    fn with_far_entries(self) -> Self {
        let reach_mm = 2.0 * self.config.max_detour_m * 1000.0;
        Self { starts: self.space.approaches(self.from, reach_mm, PathEnd::Start), ..self }
    }

    /// The shortest way to the goal.
    fn shortest(&self) -> Option<NodeRoute> {
        if is_closed_goal(self.space, self.to, self.config) {
            return None;
        }
        let goal = if self.config.ends == PathEnds::Known { PathEnd::Known } else { PathEnd::Goal };
        let goals = self.space.approaches(self.to, self.config.max_detour_m * 1000.0, goal);
        let (way, unmapped_mm) = self.shortest_to(&goals)?;
        Some(NodeRoute { unmapped_m: unmapped_mm * 1e-3, ..route_over(self.from, &way, Some(self.to)) })
    }

    /// That nothing joins the two; `spot` is what can be reached nearest to the goal.
    fn no_path(&self, spot: Option<Spot>) -> RouteError {
        let nearest = spot.map(|spot| fixed_point(spot.place));
        RouteError::NoPath { from: self.from, to: self.to, nearest, is_shut_in: self.starts.is_empty() }
    }

    /// Where what can be reached is nearest to the goal.
    fn nearest(&self) -> Option<Spot> {
        let parts = self.starts.iter().map(|start| start.joint.part).collect();
        self.space.nearest_of(&parts, corner_of(self.to))
    }

    fn shortest_to_spot(&self, spot: Spot) -> Option<NodeRoute> {
        let (way, unmapped_mm) = self.shortest_to(&[MeshEntry { joint: spot, way: Vec::new(), cost_mm: 0.0 }])?;
        let route = route_over(self.from, &way, None);
        let goal_moved_m = route.waypoints.last().map_or(0.0, |last| last.point.distance(self.to));
        Some(NodeRoute { unmapped_m: unmapped_mm * 1e-3, goal_moved_m, ..route })
    }

    /// The shortest way to any of some goals, and how much of it nobody knows.
    fn shortest_to(&self, goals: &[MeshEntry]) -> Option<(Vec<Corner>, f64)> {
        let outside_mm = |(start, goal): &(&MeshEntry, &MeshEntry)| start.cost_mm + goal.cost_mm;
        let pairs = self.starts.iter().flat_map(|start| goals.iter().map(move |goal| (start, goal)));
        let mut pairs: Vec<(&MeshEntry, &MeshEntry)> =
            pairs.filter(|(start, goal)| start.joint.part == goal.joint.part).collect();
        pairs.sort_by(|a, b| outside_mm(a).total_cmp(&outside_mm(b)));
        let ways = pairs.into_iter().take(PARTS).filter_map(|(start, goal)| {
            let way = shortest_way(&self.space.mesh, &start.joint, &goal.joint)?;
            let cost = length_mm(&way) + self.config.unmapped_factor.max(1.0) * outside_mm(&(start, goal));
            Some((cost, way, start, goal))
        });
        let (_, way, start, goal) = ways.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let unmapped_mm = self.space.unmapped_mm(&start.whole()) + self.space.unmapped_mm(&goal.whole());
        let whole = start.way.iter().chain(&way).chain(goal.way.iter().rev());
        Some((whole.copied().collect(), unmapped_mm))
    }
}

/// A node may be joined though something stands beside it; where robots are to go, nothing may.
fn is_closed_goal(space: &FreeSpace, goal: FixedPoint, config: &NodeRouteConfig) -> bool {
    if config.ends == PathEnds::Known { space.is_kept_out(goal) } else { space.is_closed_goal(goal) }
}

/// A route over nodes and edges. The way is not looked for around what is closed or blocked, beyond
/// the edges that lead through it, but it must not lead over it; and its ends must not lead through
/// walls.
fn checked(space: &FreeSpace, route: NodeRoute, config: &NodeRouteConfig) -> Option<NodeRoute> {
    let points: Vec<Corner> = route.waypoints.iter().map(|waypoint| corner_of(waypoint.point)).collect();
    let (Some(start), Some(goal)) = (points.first(), points.last()) else { return Some(route) };
    let leads_over =
        |zone: &ClosedZone| !zone.covers(*start) && points.windows(2).any(|pair| zone.is_met([pair[0], pair[1]]));
    if space.zones.iter().any(leads_over) {
        return None;
    }
    if space.over_budget().is_some() {
        return Some(route);
    }
    // What leads from the start to the first node, and from the last node to the goal.
    let is_node = |waypoint: &RoutePoint| waypoint.node.is_some();
    let (Some(first), Some(last)) =
        (route.waypoints.iter().position(is_node), route.waypoints.iter().rposition(is_node))
    else {
        return Some(route);
    };
    let (begin, end) = (&points[..=first], points[last..].iter().rev().copied().collect::<Vec<Corner>>());
    let is_walled = |leg: &[Corner], place: Corner, at: PathEnd| {
        let lines = space.wall_lines(place, config.max_detour_m * 1000.0);
        at == PathEnd::Goal && leg.len() > 1 && space.is_in_wall(place)
            // What stood under the robot is passed by where it stands, and nowhere else; only who
            // stands beside the mesh, and not beside some rectangle, gets some way out of there.
            || leg.windows(2).enumerate().any(|(number, pair)| match (number, at) {
                (0, PathEnd::Start) if space.is_beside_mesh(place) => false,
                (0, at) => space.leads_through(&lines, [pair[0], pair[1]], at),
                _ => space.leads_through(&lines, [pair[0], pair[1]], PathEnd::Goal),
            })
    };
    let (begin_mm, end_mm) = (space.unmapped_mm(begin), space.unmapped_mm(&end));
    let is_hidden = !space.views.is_empty() && end_mm > space.approach.unseen_goal_mm
        || length_mm(begin) > space.approach.start_mm && space.hides_start(begin);
    let is_walled = is_hidden || is_walled(begin, *start, PathEnd::Start) || is_walled(&end, *goal, PathEnd::Goal);
    if is_walled && config.ends != PathEnds::Known {
        return None;
    }
    Some(NodeRoute { unmapped_m: (begin_mm + end_mm) * 1e-3, ..route })
}

fn length_mm(way: &[Corner]) -> f64 {
    way.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

fn route_over(from: FixedPoint, way: &[Corner], to: Option<FixedPoint>) -> NodeRoute {
    let mut points: Vec<FixedPoint> = vec![from];
    points.extend(way.iter().map(|corner| fixed_point(*corner)));
    points.extend(to);
    points.dedup();
    // The sum of nothing is -0.0.
    let length_m = 0.0 + points.windows(2).map(|pair| pair[0].distance(pair[1])).sum::<f64>();
    let waypoints = points.into_iter().map(|point| RoutePoint { point, node: None }).collect();
    NodeRoute { length_m, waypoints, unmapped_m: 0.0, goal_moved_m: 0.0 }
}
