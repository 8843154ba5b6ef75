//! The shortest path between two places through all the free space that the map knows: the node
//! path of the paper's equation 11, drawn taut through rectangles and corridors, and of all such
//! paths the shortest.

use crate::navmesh::entry::{MeshEntry, PathEnd};
use crate::navmesh::free_space::FreeSpace;
use crate::navmesh::free_space::closed_ground::ClosedZone;
use crate::navmesh::plane::{Corner, corner_of, distance, fixed_point};
use crate::navmesh::polyanya::shortest_way;
use crate::plan::node_route::{self, NodeRoute, NodeRouteConfig, RouteError, RouteGraph, RoutePoint};
use fht_proto::FixedPoint;

/// Ways into the mesh that are tried for places outside of it: through this many of its parts.
const PARTS: usize = 4;

/// Plans from `from` to `to` (map frame) through `space`, which must be that of `map`. A place
/// outside of it joins it over ground that no rectangle covers, and the way there counts
/// [`NodeRouteConfig::unmapped_factor`] times. Of a map without a mesh ([`FreeSpace::over_budget`])
/// the path leads over nodes and edges. For a robot larger than the explorers it leads through the
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
    plan_or(space, from, to, config, |config| node_route::plan(graph, from, to, config))
}

/// Through the mesh, or as `over_nodes` plans.
fn plan_or(
    space: &FreeSpace,
    from: FixedPoint,
    to: FixedPoint,
    config: &NodeRouteConfig,
    over_nodes: impl FnOnce(&NodeRouteConfig) -> Result<NodeRoute, RouteError>,
) -> Result<NodeRoute, RouteError> {
    if space.is_kept_out(to) {
        return Err(RouteError::NoPath { from, to });
    }
    let reach_mm = config.max_detour_m * 1000.0;
    let starts = space.approaches(from, reach_mm, PathEnd::Start);
    let goals = space.approaches(to, reach_mm, PathEnd::Goal);
    let outside_mm = |(start, goal): &(&MeshEntry, &MeshEntry)| start.cost_mm + goal.cost_mm;
    let pairs = starts.iter().flat_map(|start| goals.iter().map(move |goal| (start, goal)));
    let mut pairs: Vec<(&MeshEntry, &MeshEntry)> =
        pairs.filter(|(start, goal)| start.joint.part == goal.joint.part).collect();
    pairs.sort_by(|a, b| outside_mm(a).total_cmp(&outside_mm(b)));
    let ways = pairs.into_iter().take(PARTS).filter_map(|(start, goal)| {
        let way = shortest_way(&space.mesh, &start.joint, &goal.joint)?;
        let cost = length_mm(&way) + config.unmapped_factor.max(1.0) * outside_mm(&(start, goal));
        let whole = start.way.iter().chain(&way).chain(goal.way.iter().rev());
        Some((cost, whole.copied().collect::<Vec<_>>()))
    });
    match ways.min_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((_, way)) => Ok(route_over(from, &way, to)),
        // A way over nodes all of whose legs lie in the mesh would have been found in it; the nodes
        // only say whether both places are on the map at all.
        None if space.is_mesh_needed => over_nodes(config).and(Err(RouteError::NoPath { from, to })),
        // The mesh has holes where nodes have no rectangles and edges no room; of an enormous map
        // there is none.
        None => checked(space, from, to, config, over_nodes),
    }
}

/// Over nodes and edges. The way is not looked for around what operators closed, beyond the edges
/// that lead through it, but it must not lead over it.
fn checked(
    space: &FreeSpace,
    from: FixedPoint,
    to: FixedPoint,
    config: &NodeRouteConfig,
    over_nodes: impl FnOnce(&NodeRouteConfig) -> Result<NodeRoute, RouteError>,
) -> Result<NodeRoute, RouteError> {
    let blocked = config.blocked.union(&space.closed).copied().collect();
    let route = over_nodes(&NodeRouteConfig { blocked, ..config.clone() })?;
    let start = corner_of(from);
    let leads_over = |zone: &ClosedZone| {
        let mut steps = route.waypoints.windows(2);
        !zone.contains(start) && steps.any(|pair| zone.is_met([corner_of(pair[0].point), corner_of(pair[1].point)]))
    };
    if space.zones.iter().any(leads_over) { Err(RouteError::NoPath { from, to }) } else { Ok(route) }
}

fn length_mm(way: &[Corner]) -> f64 {
    way.windows(2).map(|pair| distance(pair[0], pair[1])).sum()
}

fn route_over(from: FixedPoint, way: &[Corner], to: FixedPoint) -> NodeRoute {
    let mut points: Vec<FixedPoint> = vec![from];
    points.extend(way.iter().map(|corner| fixed_point(*corner)));
    points.push(to);
    points.dedup();
    let length_m = points.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    NodeRoute { length_m, waypoints: points.into_iter().map(|point| RoutePoint { point, node: None }).collect() }
}
