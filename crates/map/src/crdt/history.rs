//! Whether two maps are states of one: a map that was deleted and begun anew has the same name, and
//! often the same authors and numbers of nodes, but not the same moments.

use crate::crdt::leaf::NodeState;
use crate::crdt::register::Register;
use crate::crdt::state::MapState;
use fht_proto::Stamp;

/// When a node came into being, as far as the map knows, or when it was taken away.
fn moments(node: &NodeState) -> [Option<Stamp>; 2] {
    [node.kind.as_ref().map(Register::stamp), node.removed()]
}

impl MapState {
    /// Whether this map and another one have grown from one: at least half of the nodes with ids
    /// that both have were put, or taken away, at the same moment. A map without nodes has grown
    /// from nothing, and so may become any.
    #[must_use]
    pub fn shares_history(&self, other: &Self) -> bool {
        if self.all_nodes().next().is_none() {
            return true;
        }
        let (mut common, mut same) = (0_usize, 0_usize);
        for (id, node) in self.all_nodes() {
            let Some(there) = other.node_state(id) else { continue };
            let is_same = moments(node).iter().zip(moments(there)).any(|(a, b)| a.is_some() && *a == b);
            common += 1;
            same += usize::from(is_same);
        }
        common > 0 && 2 * same >= common
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_proto::{AuthorId, FixedPose, Increment, NodeId, NodeKind, Op};

    /// So many nodes, one an increment, begun at `hlc_us`.
    fn map(author: u32, nodes: u32, hlc_us: u64) -> MapState {
        let mut map = MapState::new();
        for number in 0..nodes {
            let id = NodeId { author: AuthorId(author), number };
            let put = Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose::default() };
            let number = u64::from(number);
            map.apply(&Increment {
                author: AuthorId(author),
                number: number + 1,
                hlc_us: hlc_us + number,
                ops: vec![put],
            });
        }
        map
    }

    #[test]
    fn a_map_begun_anew_is_another_one_though_its_explorer_is_the_same() {
        let old = map(7, 40, 1_000);
        assert!(old.shares_history(&map(7, 60, 1_000)), "it has grown");
        assert!(old.shares_history(&map(7, 3, 1_000)), "an older backup of it");
        assert!(!old.shares_history(&map(7, 1, 9_000)) && !old.shares_history(&map(7, 60, 9_000)));
        assert!(!old.shares_history(&map(8, 40, 1_000)) && !old.shares_history(&MapState::new()));
        assert!(MapState::new().shares_history(&old));
        let mut erased = map(7, 40, 1_000);
        let ops = (0..40).map(|number| Op::RemoveNode { id: NodeId { author: AuthorId(7), number } }).collect();
        erased.apply(&Increment { author: AuthorId(9), number: 1, hlc_us: 5_000, ops });
        assert!(erased.shares_history(&erased.clone()), "all of it was taken away");
    }
}
