//! Map refinement (paper, section III-B-4): where the map's way between two nodes is much longer
//! than the way through free space, support nodes and edges along the shorter way are added.
//!
//! The search runs on copies in a thread of its own ([`fht_worker`]).

mod roadmap;
#[cfg(test)]
mod tests;

pub use roadmap::Roadmap;
use serde::{Deserialize, Serialize};

use crate::construct::point;
use fht_map::MapState;
use fht_navigation::planning::{DistanceField, ESCAPE_REACH_M, PlanConfig, Traversable, path_length_m, region_around};
use fht_perception::grid::{CellBounds, OccupancyGrid};
use fht_perception::pose::Point2;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use fht_worker::{BackgroundWorker, Pace};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Parameters of the refinement.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RefinementConfig {
    /// A way is significantly longer above this ratio of map length to free-space length. Default
    /// 1.5 (the paper's).
    pub ratio: f64,
    /// … and by at least this much, metres. Default 1.
    pub saving_m: f64,
    /// Nodes within this of the new node are looked at, metres. Default 10 (the paper's).
    pub radius_m: f64,
    /// Shortcuts added for one new node at most. Default 3.
    pub max_shortcuts: usize,
    /// Points of a shortcut are at most this far apart, metres. Default 6: within an edge's
    /// greatest length.
    pub longest_step_m: f64,
}

impl Default for RefinementConfig {
    fn default() -> Self {
        Self { ratio: 1.5, saving_m: 1.0, radius_m: 10.0, max_shortcuts: 3, longest_step_m: 6.0 }
    }
}

/// A shorter way between two nodes through free space.
#[derive(Clone, Debug, PartialEq)]
pub struct Shortcut {
    /// Where it starts.
    pub from: NodeId,
    /// Where it ends.
    pub to: NodeId,
    /// The places between, none for a straight line.
    pub between: Vec<Point2>,
}

/// Nodes that shortcuts from `node` may lead to, with how long the map's way to them is, metres:
/// infinite where there is none.
fn candidates(roadmap: &Roadmap, node: NodeId, config: &RefinementConfig) -> Vec<(NodeId, FixedPoint, f64)> {
    let Some(here) = roadmap.position(node) else { return Vec::new() };
    let is_near = |(id, position): &(NodeId, FixedPoint)| *id != node && position.distance(here) <= config.radius_m;
    let near: BTreeMap<NodeId, FixedPoint> = roadmap.nodes().filter(is_near).collect();
    let on_map = roadmap.distances_from(node, &near.keys().copied().collect());
    let map_m = |id: NodeId| on_map.get(&id).copied().unwrap_or(f64::INFINITY);
    near.into_iter().map(|(id, position)| (id, position, map_m(id))).collect()
}

/// Ways begin at the nearest cell where a robot may be and end in the cells of nodes: so many cells
/// they are off these places at most, beyond [`ESCAPE_REACH_M`].
const ENDS_CELLS: f64 = 3.0;

/// The longest way through free space from `here` that can be a shortcut to one of the
/// [`candidates`] `near`, metres; infinite if the map has no way to one of them. `None` if not even
/// a straight way to any of them would be short enough.
fn longest_shortcut_m(
    here: FixedPoint,
    near: &[(NodeId, FixedPoint, f64)],
    resolution_m: f64,
    config: &RefinementConfig,
) -> Option<f64> {
    let ends_m = ESCAPE_REACH_M + ENDS_CELLS * resolution_m;
    let least_m = |place: FixedPoint| (here.distance(place) - ends_m).max(0.0);
    let longest_m = |map_m: f64| (map_m / config.ratio).min(map_m - config.saving_m);
    let ways = near.iter().map(|(_, place, map_m)| (least_m(*place), longest_m(*map_m)));
    ways.filter(|(least_m, longest_m)| longest_m >= least_m).map(|(_, longest_m)| longest_m).max_by(f64::total_cmp)
}

/// Looks for shortcuts from `node`, the worst detour first, so that one shortcut may serve several.
#[must_use]
pub fn shortcuts(roadmap: &Roadmap, space: &Traversable, node: NodeId, config: &RefinementConfig) -> Vec<Shortcut> {
    let Some(here) = roadmap.position(node) else { return Vec::new() };
    let mut near = candidates(roadmap, node, config);
    // What neither the map nor free space joins with the node would be looked for everywhere.
    near.retain(|(_, place, map_m)| map_m.is_finite() || space.has_way(point(here), space.cell_of(point(*place))));
    let Some(most_m) = longest_shortcut_m(here, &near, space.resolution_m(), config) else { return Vec::new() };
    let field = space.distances_within(point(here), most_m + space.resolution_m());
    shortcuts_in(Cow::Borrowed(roadmap), near, space, &field, node, config)
}

/// The same to the candidates on a roadmap, by the ways through free space from `node`, as far as
/// they may be shortcuts.
fn shortcuts_in(
    mut roadmap: Cow<'_, Roadmap>,
    mut near: Vec<(NodeId, FixedPoint, f64)>,
    space: &Traversable,
    field: &DistanceField<'_>,
    node: NodeId,
    config: &RefinementConfig,
) -> Vec<Shortcut> {
    let mut found: Vec<Shortcut> = Vec::new();
    // No map has nodes of these numbers.
    let mut numbers = (0..=u32::MAX).rev();
    for _ in 0..config.max_shortcuts {
        if let Some(last) = found.last() {
            // In a copy, so that this search knows of it.
            plan(last, &mut numbers, roadmap.to_mut(), space, config.longest_step_m);
            near = candidates(&roadmap, node, config);
        }
        let detour = |&(id, position, map_m): &(NodeId, FixedPoint, f64)| {
            let free_m = field.distance_m(space.cell_of(point(position)))?;
            let is_long = map_m > config.ratio * free_m && map_m - free_m > config.saving_m;
            is_long.then_some((map_m / free_m.max(0.1), id, position))
        };
        let tried = |id: NodeId| found.iter().any(|shortcut| shortcut.to == id);
        let worst = near
            .iter()
            .filter(|(id, ..)| !tried(*id))
            .filter_map(detour)
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, target, position)) = worst else { break };
        let mut path = field.path_to(space.cell_of(point(position)));
        // The field's path ends at a cell's centre; the shortcut ends at the node.
        path.push(point(position));
        let between = break_points(&space.shorten(&path), config.longest_step_m);
        found.push(Shortcut { from: node, to: target, between });
    }
    found
}

/// Adds the nodes, of these numbers, and the edges that a shortcut would have.
fn plan(
    shortcut: &Shortcut,
    numbers: impl Iterator<Item = u32>,
    roadmap: &mut Roadmap,
    space: &Traversable,
    longest_step_m: f64,
) {
    let mut before = shortcut.from;
    for (place, number) in shortcut.between.iter().zip(numbers) {
        let id = NodeId { author: shortcut.from.author, number };
        let position = FixedPoint::from_metres(place.x, place.y);
        let is_joined = |(_, other): &(NodeId, FixedPoint)| {
            other.distance(position) <= longest_step_m && space.is_segment_passable(*place, point(*other))
        };
        let joined: Vec<NodeId> = roadmap.nodes().filter(is_joined).map(|(id, _)| id).collect();
        roadmap.add_node(id, position);
        roadmap.add_edge(EdgeKey::new(before, id));
        for other in joined {
            roadmap.add_edge(EdgeKey::new(id, other));
        }
        before = id;
    }
    roadmap.add_edge(EdgeKey::new(before, shortcut.to));
}

/// The inner points of a path, with more where it goes straight for long.
fn break_points(path: &[Point2], longest_step_m: f64) -> Vec<Point2> {
    let mut places = Vec::new();
    for pair in path.windows(2) {
        let steps = (path_length_m(pair) / longest_step_m).ceil().max(1.0) as usize;
        places.extend((1..=steps).map(|step| pair[0] + (pair[1] - pair[0]) * (step as f64 / steps as f64)));
    }
    places.pop();
    places
}

/// Whether every part of a shortcut is still free, in the grid as it is now.
#[must_use]
pub fn is_still_free(shortcut: &Shortcut, map: &MapState, grid: &OccupancyGrid, half_width_m: f64) -> bool {
    let place_of = |id: NodeId| map.node(id).map(|node| point(node.pose.position));
    let (Some(start), Some(end)) = (place_of(shortcut.from), place_of(shortcut.to)) else { return false };
    let line: Vec<Point2> =
        std::iter::once(start).chain(shortcut.between.iter().copied()).chain(std::iter::once(end)).collect();
    line.windows(2).all(|pair| grid.is_corridor_free(pair[0], pair[1], half_width_m))
}

/// The part of the grid in which all shortcuts from `node` lie, with the nodes that they may be
/// joined with: all of it where the map has no way to some node near by, nothing of it where there
/// can be no shortcut.
#[must_use]
pub fn grid_around(
    node: NodeId,
    roadmap: &Roadmap,
    grid: &OccupancyGrid,
    plan: &PlanConfig,
    config: &RefinementConfig,
) -> OccupancyGrid {
    let longest_m = |here| longest_shortcut_m(here, &candidates(roadmap, node, config), grid.resolution_m(), config);
    let Some((here, longest_m)) = roadmap.position(node).and_then(|here| Some((here, longest_m(here)?))) else {
        return grid.part(CellBounds::EMPTY);
    };
    let way_m = ESCAPE_REACH_M + longest_m + config.longest_step_m.max(0.0);
    let walls_m = plan.robot_radius_m.max(plan.comfort_clearance_m) + ENDS_CELLS * grid.resolution_m();
    grid.part(region_around(grid, point(here), way_m + walls_m))
}

/// What the refinement thread works on.
pub struct RefinementJob {
    /// The map's nodes and edges.
    pub roadmap: Roadmap,
    /// The grid as it is now, as far as shortcuts may lead ([`grid_around`]): what is free in it is
    /// worked out beside the loop.
    pub grid: OccupancyGrid,
    /// What is free.
    pub plan: PlanConfig,
    /// The new node.
    pub node: NodeId,
}

/// Starts the refinement thread, which looks for the shortcuts of one node at a time.
///
/// # Errors
/// When the system gives no thread.
pub fn start(config: RefinementConfig, pace: Pace) -> std::io::Result<BackgroundWorker<RefinementJob, Vec<Shortcut>>> {
    BackgroundWorker::one_by_one("refine", pace, move |job: RefinementJob| {
        let space = Traversable::new(&job.grid, &job.plan);
        shortcuts(&job.roadmap, &space, job.node, &config)
    })
}
