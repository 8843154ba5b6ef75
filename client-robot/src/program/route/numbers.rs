//! Numbers for nodes and edges: ROS's routes have 16 bits for each.

use fht_map::MapState;
use fht_proto::{EdgeKey, NodeId};
use std::collections::BTreeMap;

/// Most things of a kind that have numbers.
const MOST: usize = u16::MAX as usize + 1;

/// The numbers that nodes and edges have for as long as the program runs: from 0, in the order of
/// their ids; what the map gets later has the next ones.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    nodes: BTreeMap<NodeId, u16>,
    ids: Vec<NodeId>,
    edges: BTreeMap<EdgeKey, u16>,
}

/// A map with more than 65,536 nodes or edges.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("the map has more than {MOST} {0}, and ROS numbers them with 16 bits: ask compute_path_to_pose")]
pub(super) struct TooMany(&'static str);

impl Numbers {
    /// Numbers what is new.
    ///
    /// # Errors
    /// [`TooMany`]; what has a number keeps it.
    pub(super) fn learn(&mut self, map: &MapState) -> Result<(), TooMany> {
        for node in map.nodes() {
            if !self.nodes.contains_key(&node.id) {
                let number = u16::try_from(self.ids.len()).map_err(|_| TooMany("nodes"))?;
                self.nodes.insert(node.id, number);
                self.ids.push(node.id);
            }
        }
        for edge in map.edges() {
            if !self.edges.contains_key(&edge) {
                let number = u16::try_from(self.edges.len()).map_err(|_| TooMany("edges"))?;
                self.edges.insert(edge, number);
            }
        }
        Ok(())
    }

    pub(super) fn node(&self, id: NodeId) -> Option<u16> {
        self.nodes.get(&id).copied()
    }

    pub(super) fn edge(&self, edge: EdgeKey) -> Option<u16> {
        self.edges.get(&edge).copied()
    }

    pub(super) fn id(&self, number: u16) -> Option<NodeId> {
        self.ids.get(usize::from(number)).copied()
    }

    /// How many nodes have numbers.
    pub(super) fn count(&self) -> usize {
        self.ids.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{AuthorId, FixedPose, Increment, NodeKind, Op};

    fn put(map: &mut MapState, author: u32, number: u64, nodes: &[u32]) {
        let author = AuthorId(author);
        let id = |number| NodeId { author, number };
        let pose = FixedPose::from_metres(1.0, 1.0, 0.0);
        let mut ops: Vec<Op> =
            nodes.iter().map(|&number| Op::PutNode { id: id(number), kind: NodeKind::Support, pose }).collect();
        ops.extend(nodes.windows(2).map(|pair| Op::PutEdge { edge: EdgeKey::new(id(pair[0]), id(pair[1])) }));
        map.apply(&Increment { author, number, hlc_us: number, ops });
    }

    #[test]
    fn what_has_a_number_keeps_it() {
        let (mut map, mut numbers) = (MapState::new(), Numbers::default());
        put(&mut map, 5, 1, &[0, 1, 2]);
        assert_eq!(numbers.learn(&map), Ok(()));
        let id = |author, number| NodeId { author: AuthorId(author), number };
        assert_eq!((numbers.node(id(5, 2)), numbers.id(1), numbers.count()), (Some(2), Some(id(5, 1)), 3));
        // A node of an earlier author comes behind those that are known.
        put(&mut map, 1, 1, &[7, 8]);
        assert_eq!(numbers.learn(&map), Ok(()));
        assert_eq!((numbers.node(id(5, 0)), numbers.node(id(1, 7)), numbers.id(9)), (Some(0), Some(3), None));
        let edge = |author, a, b| numbers.edge(EdgeKey::new(id(author, a), id(author, b)));
        assert_eq!((edge(5, 0, 1), edge(5, 2, 1), edge(1, 7, 8), edge(1, 7, 7)), (Some(0), Some(1), Some(2), None));
    }
}
