//! The connected parts of a graph, so that a search for a way that does not exist ends before it
//! begins.
//!
//! The sets are joined when an edge is added (disjoint sets) and never divided: nodes of two sets
//! are never connected, but nodes of one set may have lost their connection.

use crate::graph::road_graph::GraphShape;

/// The set of every node.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    /// A set of each node, which may have become part of another one.
    of: Vec<u32>,
    /// The set that a set has become part of; itself if none.
    within: Vec<u32>,
    /// How many sets each is made of.
    sets: Vec<u32>,
}

impl Parts {
    pub(crate) fn build(shape: &GraphShape) -> Self {
        let (of, firsts) = joined(shape);
        Self { of, within: (0..firsts.len() as u32).collect(), sets: vec![1; firsts.len()] }
    }

    /// The set of a node now.
    pub(crate) fn of(&self, node: u32) -> Option<u32> {
        let mut set = *self.of.get(node as usize)?;
        while self.within[set as usize] != set {
            set = self.within[set as usize];
        }
        Some(set)
    }

    /// A number was given to a node, which nothing joins yet.
    pub(crate) fn node_added(&mut self, node: u32) {
        let set = self.within.len() as u32;
        self.within.push(set);
        self.sets.push(1);
        self.of.resize(self.of.len().max(node as usize + 1), set);
        self.of[node as usize] = set;
    }

    /// An edge joins two nodes.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let Some((a, b)) = self.of(a).zip(self.of(b)).filter(|(a, b)| a != b) else { return };
        // The one of fewer goes into the other, so that no way from set to set is long.
        let sets = |set: u32| self.sets[set as usize];
        let (into, from) = if sets(a) >= sets(b) { (a, b) } else { (b, a) };
        self.within[from as usize] = into;
        self.sets[into as usize] += self.sets[from as usize];
    }

    /// Bytes on the heap.
    pub(crate) fn bytes(&self) -> usize {
        (self.of.capacity() + self.within.capacity() + self.sets.capacity()) * size_of::<u32>()
    }
}

/// Which part each node is in, and the first node of each part.
pub(crate) fn joined(shape: &GraphShape) -> (Vec<u32>, Vec<u32>) {
    let mut parts = vec![u32::MAX; shape.adjacency.len()];
    let mut firsts = Vec::new();
    let mut open = Vec::new();
    for first in 0..parts.len() as u32 {
        if parts[first as usize] != u32::MAX {
            continue;
        }
        let part = firsts.len() as u32;
        firsts.push(first);
        parts[first as usize] = part;
        open.push(first);
        while let Some(node) = open.pop() {
            for arc in shape.adjacency.arcs(node) {
                if parts[arc.to as usize] == u32::MAX {
                    parts[arc.to as usize] = part;
                    open.push(arc.to);
                }
            }
        }
    }
    (parts, firsts)
}
