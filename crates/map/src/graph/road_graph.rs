//! The map as a graph to search: its nodes numbered from 0, their positions and the lengths of
//! their edges in plain arrays.
//!
//! A [`MapState`] answers for what is shown; this follows it. It is built once, and then changed
//! node by node and edge by edge, so that an increment costs what it changes and not what the map
//! holds. Lengths are whole micrometres, as in [`graph`](crate::graph::dijkstra): sums do not
//! depend on their order, and both find paths of the same length.
//!
//! The number of a node holds until the node is removed, and is then given to another one. It
//! depends on the order of the changes, so numbers stay in this process: what leaves it are ids. Of
//! several equally short paths, which one is found may depend on the numbers; its length does not.

use crate::crdt::state::MapState;
use crate::graph::adjacency::Adjacency;
use crate::graph::dijkstra::distance_um;
use fht_proto::{EdgeKey, FixedPoint, NodeId};
use std::collections::BTreeMap;

/// Nodes, positions and edges, by number.
#[derive(Clone, Debug, Default)]
pub struct RoadGraph {
    numbers: BTreeMap<NodeId, u32>,
    ids: Vec<NodeId>,
    /// Numbers that no node has at present.
    free: Vec<u32>,
    edges: usize,
    shape: GraphShape,
}

/// Roads without names: all that distances depend on.
#[derive(Clone, Debug, Default)]
pub(crate) struct GraphShape {
    pub positions: Vec<FixedPoint>,
    pub adjacency: Adjacency,
}

impl GraphShape {
    /// Where the edges of a node lead to, and how long they are, micrometres.
    #[inline]
    pub(crate) fn steps(&self, from: u32) -> impl Iterator<Item = (u32, u64)> + '_ {
        self.adjacency.arcs(from).iter().map(move |arc| {
            let length_um = arc.stored_um().map_or_else(|| self.apart_um(from, arc.to), u64::from);
            (arc.to, length_um)
        })
    }

    /// How far two nodes are apart, micrometres.
    pub(crate) fn apart_um(&self, a: u32, b: u32) -> u64 {
        distance_um(self.positions[a as usize], self.positions[b as usize])
    }
}

impl RoadGraph {
    /// What a map shows.
    #[must_use]
    pub fn of_map(map: &MapState) -> Self {
        Self::new(map.nodes().map(|node| (node.id, node.pose.position)), map.edges())
    }

    /// Nodes and edges. Of nodes with one id the first counts; edges to nodes that are not given,
    /// and edges of a node with itself, do not.
    #[must_use]
    pub fn new(
        nodes: impl IntoIterator<Item = (NodeId, FixedPoint)>,
        edges: impl IntoIterator<Item = EdgeKey>,
    ) -> Self {
        let mut nodes: Vec<(NodeId, FixedPoint)> = nodes.into_iter().collect();
        nodes.sort_by_key(|(id, _)| *id); // stable
        nodes.dedup_by_key(|(id, _)| *id);
        // Neighbours get numbers near each other, whatever their ids: a search then touches memory
        // that it has touched.
        nodes.sort_by_cached_key(|(id, position)| (along_curve(*position), *id));
        let numbers: BTreeMap<NodeId, u32> = nodes.iter().map(|(id, _)| *id).zip(0..).collect();
        let (ids, positions): (Vec<NodeId>, Vec<FixedPoint>) = nodes.into_iter().unzip();
        let ends = |edge: EdgeKey| Some((*numbers.get(&edge.low())?, *numbers.get(&edge.high())?));
        let mut edges: Vec<(u32, u32)> = edges.into_iter().filter_map(ends).filter(|(a, b)| a != b).collect();
        edges.sort_unstable();
        edges.dedup();
        let length = |&(a, b): &(u32, u32)| (a, b, distance_um(positions[a as usize], positions[b as usize]));
        let lengths: Vec<(u32, u32, u64)> = edges.iter().map(length).collect();
        let adjacency = Adjacency::of(positions.len(), &lengths);
        Self { numbers, ids, free: Vec::new(), edges: lengths.len(), shape: GraphShape { positions, adjacency } }
    }

    /// Nodes.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.numbers.len()
    }

    /// Edges.
    #[must_use]
    pub fn edges(&self) -> usize {
        self.edges
    }

    /// Numbers are below this. Some may belong to no node.
    #[must_use]
    pub fn numbers(&self) -> usize {
        self.ids.len()
    }

    /// The number of a node.
    #[must_use]
    pub fn number(&self, id: NodeId) -> Option<u32> {
        self.numbers.get(&id).copied()
    }

    /// The node of a number. A number that belongs to no node at present gives the last one that it
    /// belonged to.
    #[must_use]
    pub fn id(&self, number: u32) -> Option<NodeId> {
        self.ids.get(number as usize).copied()
    }

    /// Where a node is.
    #[must_use]
    pub fn position(&self, number: u32) -> Option<FixedPoint> {
        self.shape.positions.get(number as usize).copied()
    }

    /// Where the edges of a node lead to, and how long they are, micrometres.
    pub fn steps(&self, from: u32) -> impl Iterator<Item = (u32, u64)> + '_ {
        self.shape.steps(from)
    }

    /// Whether an edge joins two nodes.
    #[must_use]
    pub fn is_joined(&self, a: u32, b: u32) -> bool {
        self.shape.adjacency.is_joined(a, b)
    }

    pub(crate) fn shape(&self) -> &GraphShape {
        &self.shape
    }

    /// Adds a node without edges and returns its number; a node that is there keeps its number and
    /// is moved.
    pub fn put_node(&mut self, id: NodeId, position: FixedPoint) -> u32 {
        if let Some(number) = self.number(id) {
            self.move_node(number, position);
            return number;
        }
        let number = self.free.pop().unwrap_or_else(|| {
            self.ids.push(id);
            self.shape.positions.push(position);
            self.shape.adjacency.grow(self.ids.len());
            self.ids.len() as u32 - 1 // a map of 2³² nodes fits into no memory
        });
        self.numbers.insert(id, number);
        self.ids[number as usize] = id;
        self.shape.positions[number as usize] = position;
        number
    }

    /// Puts a node elsewhere; its edges become as long as their nodes are then apart.
    pub fn move_node(&mut self, number: u32, position: FixedPoint) {
        let Some(place) = self.shape.positions.get_mut(number as usize) else { return };
        *place = position;
        let others: Vec<u32> = self.steps(number).map(|(other, _)| other).collect();
        for other in others {
            self.shape.adjacency.put(number, other, self.shape.apart_um(number, other));
        }
    }

    /// Takes a node and its edges away. Returns the nodes that they joined it to.
    pub fn remove_node(&mut self, id: NodeId) -> Vec<u32> {
        let Some(number) = self.numbers.remove(&id) else { return Vec::new() };
        let others: Vec<u32> = self.steps(number).map(|(other, _)| other).collect();
        for &other in &others {
            self.shape.adjacency.remove(number, other);
        }
        self.edges -= others.len();
        self.free.push(number);
        others
    }

    /// Joins two nodes. Whether that is new; false for numbers of no nodes, or of one.
    pub fn put_edge(&mut self, a: u32, b: u32) -> bool {
        let are_nodes = [a, b].iter().all(|&end| self.id(end).and_then(|id| self.number(id)) == Some(end));
        if !are_nodes || a == b {
            return false;
        }
        let is_new = self.shape.adjacency.put(a, b, self.shape.apart_um(a, b));
        self.edges += usize::from(is_new);
        is_new
    }

    /// Takes an edge away. Whether there was one.
    pub fn remove_edge(&mut self, a: u32, b: u32) -> bool {
        let was_there = self.shape.adjacency.remove(a, b);
        self.edges -= usize::from(was_there);
        was_there
    }

    /// Bytes on the heap, those of the ids estimated.
    #[must_use]
    pub fn bytes(&self) -> usize {
        // A B-tree's leaf holds up to 11 pairs and one pointer; built in order it is full but for
        // the last.
        let numbers = self.numbers.len() * (size_of::<(NodeId, u32)>() + 2);
        let arrays = self.ids.capacity() * size_of::<NodeId>()
            + self.shape.positions.capacity() * size_of::<FixedPoint>()
            + self.free.capacity() * size_of::<u32>();
        numbers + arrays + self.shape.adjacency.bytes()
    }
}

/// Place on a curve that fills the plane (Morton's): the bits of x and y in turn.
fn along_curve(position: FixedPoint) -> u64 {
    let spread = |mm: i32| {
        let mut bits = u64::from(mm.cast_unsigned() ^ (1 << 31)); // negative numbers before positive ones
        for (shift, mask) in [
            (16, 0x0000_FFFF_0000_FFFF),
            (8, 0x00FF_00FF_00FF_00FF),
            (4, 0x0F0F_0F0F_0F0F_0F0F),
            (2, 0x3333_3333_3333_3333),
            (1, 0x5555_5555_5555_5555),
        ] {
            bits = (bits | bits << shift) & mask;
        }
        bits
    };
    spread(position.x_mm) | spread(position.y_mm) << 1
}
