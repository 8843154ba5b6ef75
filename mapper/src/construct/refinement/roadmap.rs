//! The nodes and edges of a map without their contents: light enough to be handed to another
//! thread, and open to nodes and edges that are only planned.

use fht_map::MapState;
use fht_proto::{EdgeKey, FixedPoint, Increment, NodeId, Op};
use pathfinding::directed::dijkstra::dijkstra_reach;
use std::collections::{BTreeMap, BTreeSet};

/// Micrometres in a metre: sums of whole numbers are the same in any order.
const UM_PER_M: f64 = 1e6;

/// Nodes by place, and which are joined.
#[derive(Clone, Debug, Default)]
pub struct Roadmap {
    positions: BTreeMap<NodeId, FixedPoint>,
    neighbours: BTreeMap<NodeId, Vec<NodeId>>,
}

impl Roadmap {
    /// The nodes and edges that a map shows.
    #[must_use]
    pub fn of(map: &MapState) -> Self {
        let mut roadmap = Self::default();
        for node in map.nodes() {
            roadmap.add_node(node.id, node.pose.position);
        }
        for edge in map.edges() {
            roadmap.add_edge(edge);
        }
        roadmap
    }

    /// Adds the nodes and edges that an increment puts. Moves and removals are not followed.
    pub(crate) fn add_put_by(&mut self, increment: &Increment) {
        for op in &increment.ops {
            match op {
                Op::PutNode { id, pose, .. } => self.add_node(*id, pose.position),
                Op::PutEdge { edge } => self.add_edge(*edge),
                _ => {}
            }
        }
    }

    /// Adds a node.
    pub fn add_node(&mut self, id: NodeId, position: FixedPoint) {
        self.positions.insert(id, position);
    }

    /// Joins two nodes by a straight line.
    pub fn add_edge(&mut self, edge: EdgeKey) {
        for (from, to) in [(edge.low(), edge.high()), (edge.high(), edge.low())] {
            self.neighbours.entry(from).or_default().push(to);
        }
    }

    /// Where a node is.
    #[must_use]
    pub fn position(&self, id: NodeId) -> Option<FixedPoint> {
        self.positions.get(&id).copied()
    }

    /// All nodes, in the order of their ids.
    pub fn nodes(&self) -> impl Iterator<Item = (NodeId, FixedPoint)> + '_ {
        self.positions.iter().map(|(id, position)| (*id, *position))
    }

    /// Shortest ways from a node to those of `targets` that can be reached, metres. The search ends
    /// with the last of them; if some cannot be reached, it visits all that `from` is joined with.
    #[must_use]
    pub fn distances_from(&self, from: NodeId, targets: &BTreeSet<NodeId>) -> BTreeMap<NodeId, f64> {
        let steps = |id: &NodeId| -> Vec<(NodeId, u64)> {
            let Some(here) = self.position(*id) else { return Vec::new() };
            let near = self.neighbours.get(id).into_iter().flatten();
            let length_um = |there: FixedPoint| (here.distance(there) * UM_PER_M).round() as u64;
            near.filter_map(|next| Some((*next, length_um(self.position(*next)?)))).collect()
        };
        let reached = dijkstra_reach(&from, steps).filter(|item| targets.contains(&item.node));
        reached.take(targets.len()).map(|item| (item.node, item.total_cost as f64 / UM_PER_M)).collect()
    }
}
