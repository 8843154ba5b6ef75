//! Shortest ways over nodes and edges.

use crate::state::MapState;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};

/// The nodes and edges of a map without their contents: light enough to be handed to another thread, and open to
/// changes that are not in the map (an edge that is blocked today, an edge that is only planned).
#[derive(Clone, Debug, Default)]
pub struct Graph {
    positions: BTreeMap<NodeId, FixedPoint>,
    neighbours: BTreeMap<NodeId, Vec<NodeId>>,
}

/// A node in the queue, nearest first.
struct Queued {
    cost_m: f64,
    id: NodeId,
}

impl PartialEq for Queued {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Queued {}
impl PartialOrd for Queued {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Queued {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost_m.total_cmp(&self.cost_m).then_with(|| other.id.cmp(&self.id))
    }
}

/// Costs from a set of starts, and the way back to them.
#[derive(Clone, Debug, Default)]
pub struct Distances {
    costs_m: BTreeMap<NodeId, f64>,
    previous: BTreeMap<NodeId, NodeId>,
}

impl Distances {
    /// Cost of reaching a node, metres; `None` if it cannot be reached.
    #[must_use]
    pub fn cost_m(&self, id: NodeId) -> Option<f64> {
        self.costs_m.get(&id).copied()
    }

    /// The nodes from a start to `id`, both included; empty if `id` cannot be reached.
    #[must_use]
    pub fn path_to(&self, id: NodeId) -> Vec<NodeId> {
        if !self.costs_m.contains_key(&id) {
            return Vec::new();
        }
        let mut path = vec![id];
        let mut current = id;
        while let Some(&before) = self.previous.get(&current) {
            path.push(before);
            current = before;
        }
        path.reverse();
        path
    }
}

impl Graph {
    /// The nodes and edges that a map shows.
    #[must_use]
    pub fn of(state: &MapState) -> Self {
        let mut graph = Self::default();
        for node in state.nodes() {
            graph.add_node(node.id, node.pose.position);
        }
        for edge in state.edges() {
            graph.add_edge(edge);
        }
        graph
    }

    /// Adds a node, or moves it.
    pub fn add_node(&mut self, id: NodeId, position: FixedPoint) {
        self.positions.insert(id, position);
    }

    /// Adds an edge; its length is the distance of its ends.
    pub fn add_edge(&mut self, edge: EdgeKey) {
        for (from, to) in [(edge.low(), edge.high()), (edge.high(), edge.low())] {
            let neighbours = self.neighbours.entry(from).or_default();
            if !neighbours.contains(&to) {
                neighbours.push(to);
            }
        }
    }

    /// Takes an edge away.
    pub fn remove_edge(&mut self, edge: EdgeKey) {
        for (from, to) in [(edge.low(), edge.high()), (edge.high(), edge.low())] {
            if let Some(neighbours) = self.neighbours.get_mut(&from) {
                neighbours.retain(|id| *id != to);
            }
        }
    }

    /// Where a node is.
    #[must_use]
    pub fn position(&self, id: NodeId) -> Option<FixedPoint> {
        self.positions.get(&id).copied()
    }

    /// All nodes with their positions, in the order of their ids.
    pub fn nodes(&self) -> impl Iterator<Item = (NodeId, FixedPoint)> + '_ {
        self.positions.iter().map(|(id, position)| (*id, *position))
    }

    /// Least costs from any of `starts`, each with what it costs to be there (Dijkstra).
    #[must_use]
    pub fn distances(&self, starts: impl IntoIterator<Item = (NodeId, f64)>) -> Distances {
        let mut distances = Distances::default();
        let mut queue = BinaryHeap::new();
        for (id, cost_m) in starts {
            let known = self.positions.contains_key(&id);
            if known && distances.costs_m.get(&id).is_none_or(|&held| cost_m < held) {
                distances.costs_m.insert(id, cost_m);
                queue.push(Queued { cost_m, id });
            }
        }
        while let Some(Queued { cost_m, id }) = queue.pop() {
            if distances.costs_m.get(&id).is_some_and(|&held| cost_m > held) {
                continue;
            }
            let Some(&here) = self.positions.get(&id) else { continue };
            for &next in self.neighbours.get(&id).into_iter().flatten() {
                let Some(&there) = self.positions.get(&next) else { continue };
                let cost_m = cost_m + here.distance(there);
                if distances.costs_m.get(&next).is_none_or(|&held| cost_m < held) {
                    distances.costs_m.insert(next, cost_m);
                    distances.previous.insert(next, id);
                    queue.push(Queued { cost_m, id: next });
                }
            }
        }
        distances
    }

    /// Shortest distances from one node, metres.
    #[must_use]
    pub fn distances_from(&self, id: NodeId) -> Distances {
        self.distances([(id, 0.0)])
    }

    /// The shortest path between two nodes: its length in metres and its nodes, both ends included.
    #[must_use]
    pub fn shortest_path(&self, from: NodeId, to: NodeId) -> Option<(f64, Vec<NodeId>)> {
        let distances = self.distances_from(from);
        Some((distances.cost_m(to)?, distances.path_to(to)))
    }
}
