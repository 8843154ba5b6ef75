//! Nodes that others made and that are not as they say any more: something stands where an edge
//! leads, or a node saw walls where nothing is. (Not in the paper, whose buildings do not change.)
//!
//! What this robot's own scans show counts, and nothing else. An edge or a rectangle that something
//! stands in is corrected at once. A main node that saw what is no longer there loses trust each
//! time that a robot comes by, gets it back when what it saw is there, and is retired when little
//! is left. A node in whose place something stands is retired at once, and so is one within
//! something, to which no edge leads any more.

use super::config::{BuilderConfig, MapChangeConfig};
use super::{edges, point};
use fht_map::{FULL_TRUST, MapState, NodeRef};
use fht_perception::frame::LaserScan;
use fht_perception::free_rectangle::{self, FreeRectangleConfig};
use fht_perception::grid::{Cell, CellState, OccupancyGrid};
use fht_perception::pose::{Point2, from_fixed};
use fht_proto::{EdgeKey, FixedPoint, NodeId, NodeKind, Op, Rect};
use std::collections::{BTreeMap, BTreeSet};

/// What was found of nodes so far.
#[derive(Clone, Debug, Default)]
pub(super) struct MapChange {
    looked_at_m: Option<f64>,
    /// Way driven when a node's scan was last judged, metres.
    judged_at_m: BTreeMap<NodeId, f64>,
    /// Nodes of which an edge was found to lead through something.
    cut_off: BTreeSet<NodeId>,
}

impl MapChange {
    /// The operations for the nodes around `here` that are not `is_own`.
    pub(super) fn look(
        &mut self,
        here: FixedPoint,
        odometer_m: f64,
        state: &MapState,
        grid: &OccupancyGrid,
        is_own: impl Fn(NodeId) -> bool,
        builder: &BuilderConfig,
    ) -> Vec<Op> {
        let config = &builder.doubt;
        if self.looked_at_m.is_some_and(|at_m| odometer_m - at_m < config.every_m) {
            return Vec::new();
        }
        self.looked_at_m = Some(odometer_m);
        let mut ops = Vec::new();
        for (_, id, position) in edges::nearby_nodes(state, here, config.reach_m) {
            let Some(node) = state.node(id).filter(|_| !is_own(id)) else { continue };
            if is_occupied_around(grid, point(position), 0.0) {
                self.forget(id);
                ops.push(Op::RemoveNode { id });
                continue;
            }
            let edges: Vec<EdgeKey> = state.neighbours(id).map(|other| EdgeKey::new(id, other.id)).collect();
            let is_blocked = |edge: &EdgeKey| edges::is_blocked(state, grid, *edge, &is_own, &builder.edges);
            let blocked: Vec<EdgeKey> = edges.iter().copied().filter(is_blocked).collect();
            if !blocked.is_empty() {
                self.cut_off.insert(id);
            }
            if blocked.len() == edges.len() && self.cut_off.contains(&id) && is_enclosed(grid, point(position), config)
            {
                self.forget(id);
                ops.push(Op::RemoveNode { id });
                continue;
            }
            ops.extend(free_space_op(&node, grid, &builder.free_space, config));
            ops.extend(blocked.into_iter().map(|edge| Op::RemoveEdge { edge }));
            ops.extend(self.judge(&node, odometer_m, grid, config));
        }
        // An edge between two such nodes was found at both.
        ops.dedup();
        ops
    }

    fn forget(&mut self, id: NodeId) {
        self.judged_at_m.remove(&id);
        self.cut_off.remove(&id);
    }

    /// What becomes of a main node's trust.
    fn judge(
        &mut self,
        node: &NodeRef<'_>,
        odometer_m: f64,
        grid: &OccupancyGrid,
        config: &MapChangeConfig,
    ) -> Option<Op> {
        let scan = &node.signature.filter(|_| node.kind == NodeKind::Main)?.scan;
        if self.judged_at_m.get(&node.id).is_some_and(|at_m| odometer_m - at_m < config.visit_m) {
            return None;
        }
        let map_from_node = from_fixed(node.pose);
        let points = LaserScan::record_points_in_base(scan);
        let seen = points.iter().map(|end| map_from_node * end).filter(|end| grid.is_own(grid.cell_of(*end)));
        let (mut judged, mut gone) = (0_usize, 0_usize);
        for end in seen {
            judged += 1;
            gone +=
                usize::from(grid.is_surely_free(grid.cell_of(end)) && !is_occupied_around(grid, end, config.slack_m));
        }
        if judged < config.least_returns {
            return None;
        }
        let share = gone as f64 / judged as f64;
        let trust = if share > config.contradicted {
            node.trust.saturating_sub(config.loss)
        } else if share < config.confirmed {
            node.trust.saturating_add(config.gain).min(FULL_TRUST)
        } else {
            node.trust
        };
        self.judged_at_m.insert(node.id, odometer_m);
        if trust < config.retired_below {
            self.forget(node.id);
            return Some(Op::RemoveNode { id: node.id });
        }
        (trust != node.trust).then_some(Op::SetTrust { id: node.id, percent: trust })
    }
}

/// The rectangle of a node that another robot made, if it has none, or if this robot has seen
/// something well inside of it: what is free there now.
pub(super) fn free_space_op(
    node: &NodeRef<'_>,
    grid: &OccupancyGrid,
    free_space: &FreeRectangleConfig,
    config: &MapChangeConfig,
) -> Option<Op> {
    let position = node.pose.position;
    let Some(rect) = node.free_space else {
        // Its maker grows it when it makes the next one, if it lives to do so.
        let rect = free_rectangle::grow(grid, position, free_space);
        return rect.map(|rect| Op::SetFreeSpace { id: node.id, rect: Some(rect) });
    };
    let slack_mm = (config.slack_m * 1000.0) as u16;
    let inner = |reach_mm: u16| reach_mm.saturating_sub(slack_mm);
    let inside = Rect {
        west_mm: inner(rect.west_mm),
        east_mm: inner(rect.east_mm),
        south_mm: inner(rect.south_mm),
        north_mm: inner(rect.north_mm),
    };
    free_rectangle::is_obstructed(grid, position, &inside)
        .then(|| Op::SetFreeSpace { id: node.id, rect: free_rectangle::grow(grid, position, free_space) })
}

/// Whether a place lies within something: this robot's own scans do not say that it is free, and do
/// say that there is something beside it.
fn is_enclosed(grid: &OccupancyGrid, place: Point2, config: &MapChangeConfig) -> bool {
    let cell = grid.cell_of(place);
    let is_free = grid.is_own(cell) && grid.state(cell) == CellState::Free;
    !is_free && is_occupied_around(grid, place, config.enclosed_m)
}

/// Whether a cell that this robot's own scans say is occupied has its centre within `radius_m` of a
/// place, or the place in it.
fn is_occupied_around(grid: &OccupancyGrid, place: Point2, radius_m: f64) -> bool {
    let centre = grid.cell_of(place);
    let reach = (radius_m / grid.resolution_m()).ceil() as i32;
    let around = (-reach..=reach).flat_map(|dj| (-reach..=reach).map(move |di| (di, dj)));
    around.map(|(di, dj)| Cell { i: centre.i + di, j: centre.j + dj }).any(|cell| {
        let is_near = cell == centre || (grid.centre(cell) - place).norm() <= radius_m;
        is_near && grid.state(cell) == CellState::Occupied && grid.is_own(cell)
    })
}
