//! How the kept nodes hang together, and on the first map.

use crate::operations::joint_grid::point;
use crate::operations::node_selection::{Kept, NodeSelectionConfig};
use fht_map::MapState;
use fht_perception::drivable_line::{DrivableLineConfig, lines_to};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Pose2, to_fixed};
use fht_proto::{EdgeKey, FixedPoint, NodeId, NodeKind};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Edges of the joint map that are not the first map's; ends are ids of the maps that they came
/// from.
#[derive(Debug, Default)]
pub(crate) struct Joints {
    /// Between kept nodes.
    pub(crate) own: BTreeSet<EdgeKey>,
    /// From kept nodes (first) to the first map's (second).
    pub(crate) across: BTreeSet<(NodeId, NodeId)>,
    /// Kept nodes that no way leads to: they are not kept after all.
    pub(crate) left_out: usize,
}

pub(crate) struct Joiner<'a> {
    pub(crate) a: &'a MapState,
    pub(crate) b: &'a MapState,
    pub(crate) a_from_nodes: &'a BTreeMap<NodeId, Pose2>,
    pub(crate) grid: &'a OccupancyGrid,
    pub(crate) edges: &'a DrivableLineConfig,
    pub(crate) keep: &'a NodeSelectionConfig,
}

impl Joiner<'_> {
    fn position(&self, id: NodeId) -> Option<FixedPoint> {
        self.a_from_nodes.get(&id).map(|pose| to_fixed(pose).position)
    }

    /// The second map's edges on which nothing stands.
    fn open_edges(&self) -> BTreeMap<NodeId, Vec<NodeId>> {
        let mut open: BTreeMap<NodeId, Vec<NodeId>> = BTreeMap::new();
        for edge in self.b.edges() {
            let (Some(low), Some(high)) = (self.position(edge.low()), self.position(edge.high())) else { continue };
            if self.grid.is_corridor_unoccupied(point(low), point(high), self.edges.blocked_m) {
                open.entry(edge.low()).or_default().push(edge.high());
                open.entry(edge.high()).or_default().push(edge.low());
            }
        }
        open
    }

    /// The first map's nodes that can be reached from a node of the second in a straight line.
    fn lines(&self, id: NodeId) -> Vec<NodeId> {
        let Some(here) = self.position(id) else { return Vec::new() };
        let mut near: Vec<(f64, NodeId, FixedPoint)> = self
            .a
            .nodes()
            .map(|node| (node.pose.position.distance(here), node.id, node.pose.position))
            .filter(|&(distance, ..)| distance <= self.edges.longest_m)
            .collect();
        near.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        lines_to(self.grid, here, near, self.edges)
    }

    /// Joins the kept nodes with each other and with the first map. Nodes that hold them together
    /// are kept, too.
    pub(crate) fn join(&self, kept: &mut BTreeMap<NodeId, Kept>) -> Joints {
        let open = self.open_edges();
        let mut lines: BTreeMap<NodeId, Vec<NodeId>> = kept.keys().map(|id| (*id, self.lines(*id))).collect();
        let mut left_out = 0;
        loop {
            let attached = attached(kept, &open, &lines);
            let Some(alone) = kept.keys().find(|id| !attached.contains(id)).copied() else { break };
            let part = part_of(alone, kept, &open);
            match self.way_to_first(&part, &attached, &open, &mut lines) {
                Some(way) => {
                    for id in way {
                        lines.entry(id).or_insert_with(|| self.lines(id));
                        let at = &self.a_from_nodes[&id];
                        kept.entry(id).or_insert_with(|| Kept::at(at, NodeKind::Support, self.grid, self.keep));
                    }
                }
                None => {
                    left_out += part.len();
                    part.iter().for_each(|id| _ = kept.remove(id));
                }
            }
        }
        let mut joints = Joints { left_out, ..Joints::default() };
        for id in kept.keys() {
            let own = open.get(id).into_iter().flatten().filter(|other| kept.contains_key(other));
            joints.own.extend(own.map(|other| EdgeKey::new(*id, *other)));
            joints.across.extend(lines[id].iter().map(|other| (*id, *other)));
        }
        joints
    }

    /// The nodes on the shortest way (in edges) over the second map from a part of it to what hangs
    /// on the first map, without the part itself.
    fn way_to_first(
        &self,
        part: &BTreeSet<NodeId>,
        attached: &BTreeSet<NodeId>,
        open: &BTreeMap<NodeId, Vec<NodeId>>,
        lines: &mut BTreeMap<NodeId, Vec<NodeId>>,
    ) -> Option<Vec<NodeId>> {
        let mut before: BTreeMap<NodeId, Option<NodeId>> = part.iter().map(|id| (*id, None)).collect();
        let mut queue: VecDeque<NodeId> = part.iter().copied().collect();
        while let Some(here) = queue.pop_front() {
            let is_there = attached.contains(&here)
                || (!part.contains(&here) && !lines.entry(here).or_insert_with(|| self.lines(here)).is_empty());
            if is_there {
                let mut way = Vec::new();
                let mut at = Some(here);
                while let Some(id) = at.filter(|id| !part.contains(id)) {
                    way.push(id);
                    at = before.get(&id).copied().flatten();
                }
                return Some(way);
            }
            for next in open.get(&here).into_iter().flatten() {
                if !before.contains_key(next) {
                    before.insert(*next, Some(here));
                    queue.push_back(*next);
                }
            }
        }
        None
    }
}

/// The kept nodes that hang on the first map, directly or over others.
fn attached(
    kept: &BTreeMap<NodeId, Kept>,
    open: &BTreeMap<NodeId, Vec<NodeId>>,
    lines: &BTreeMap<NodeId, Vec<NodeId>>,
) -> BTreeSet<NodeId> {
    let mut found: BTreeSet<NodeId> =
        kept.keys().filter(|id| lines.get(id).is_some_and(|lines| !lines.is_empty())).copied().collect();
    spread(&mut found, kept, open);
    found
}

/// The kept nodes that hang together with one.
fn part_of(id: NodeId, kept: &BTreeMap<NodeId, Kept>, open: &BTreeMap<NodeId, Vec<NodeId>>) -> BTreeSet<NodeId> {
    let mut part = BTreeSet::from([id]);
    spread(&mut part, kept, open);
    part
}

fn spread(found: &mut BTreeSet<NodeId>, kept: &BTreeMap<NodeId, Kept>, open: &BTreeMap<NodeId, Vec<NodeId>>) {
    let mut waiting: Vec<NodeId> = found.iter().copied().collect();
    while let Some(here) = waiting.pop() {
        for next in open.get(&here).into_iter().flatten() {
            if kept.contains_key(next) && found.insert(*next) {
                waiting.push(*next);
            }
        }
    }
}
