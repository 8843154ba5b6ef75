//! New nodes, with their edges.

use super::edges::edges_of;
use super::{Builder, Footing, Hierarchy, PlaceObservation};
use crate::publish::Journal;
use crate::slam::SlamEstimate;
use fht_perception::free_rectangle;
use fht_perception::pose::{Point2, pose, to_fixed};
use fht_proto::{EdgeKey, FixedPoint, NodeId, NodeKind, Op, Signature};
use std::collections::BTreeSet;

/// Two nodes and the places through which they are to be joined.
#[derive(Clone, Copy, Debug)]
pub struct Chain<'a> {
    /// One end.
    pub from: NodeId,
    /// Places of the new support nodes, in order.
    pub between: &'a [Point2],
    /// The other end.
    pub to: NodeId,
}

impl Builder {
    /// The operations that make a main node of a place, and the node.
    pub fn make_main(
        &mut self,
        chosen: PlaceObservation,
        journal: &mut Journal,
        estimate: &SlamEstimate<'_>,
    ) -> (NodeId, Vec<Op>) {
        let position = to_fixed(&estimate.locate(&chosen.anchored)).position;
        let signature = Signature { descriptor: chosen.descriptor, scan: chosen.scan };
        let footing = Footing { anchored: chosen.anchored, frame: Some(chosen.frame) };
        let made = self.make_node(footing, Some(signature), journal, estimate);
        self.selection.chose(made.0, position, chosen.information);
        made
    }

    pub(super) fn make_node(
        &mut self,
        footing: Footing,
        signature: Option<Signature>,
        journal: &mut Journal,
        estimate: &SlamEstimate<'_>,
    ) -> (NodeId, Vec<Op>) {
        let id = journal.fresh_node();
        let kind = if signature.is_some() { NodeKind::Main } else { NodeKind::Support };
        let grid = estimate.grid;
        let pose = to_fixed(&estimate.locate(&footing.anchored));
        self.footings.insert(id, footing);
        let mut ops = vec![Op::PutNode { id, kind, pose }];
        if let Some(signature) = signature {
            ops.push(Op::SetSignature { id, signature });
        }
        let edges = edges_of(journal.state(), grid, id, pose.position, &self.config.edges);
        let previous = self.newest.replace(id);
        let is_alone = edges.is_empty() && self.config.hierarchy == Hierarchy::MainOnly;
        let by_way_driven = previous.filter(|_| is_alone).map(|previous| EdgeKey::new(previous, id));
        ops.extend(edges.into_iter().chain(by_way_driven).map(|edge| Op::PutEdge { edge }));
        ops.extend(previous.and_then(|previous| self.free_space_op(previous, journal, grid)));
        ops.extend(self.corrections_near(pose.position, previous, journal, grid));
        (id, ops)
    }

    /// A support node at a place where the robot need not have been: it hangs on the nearest
    /// keyframe.
    pub(super) fn put_support(&mut self, id: NodeId, place: Point2, estimate: &SlamEstimate<'_>) -> Op {
        let map_from_place = pose(place.x, place.y, 0.0);
        self.footings.insert(id, Footing { anchored: estimate.anchor(&map_from_place), frame: None });
        Op::PutNode { id, kind: NodeKind::Support, pose: to_fixed(&map_from_place) }
    }

    /// The operations that join two nodes by support nodes in between (a shortcut). Each new node
    /// also gets the edges that any new node gets.
    pub fn make_chain(&mut self, chain: &Chain<'_>, journal: &mut Journal, estimate: &SlamEstimate<'_>) -> Vec<Op> {
        let grid = estimate.grid;
        let mut ops = Vec::new();
        let mut edges = BTreeSet::new();
        let mut before = chain.from;
        for place in chain.between {
            let id = journal.fresh_node();
            let position = FixedPoint::from_metres(place.x, place.y);
            ops.push(self.put_support(id, *place, estimate));
            let rect = free_rectangle::grow(grid, position, &self.config.free_space);
            ops.extend(rect.map(|rect| Op::SetFreeSpace { id, rect: Some(rect) }));
            edges.insert(EdgeKey::new(before, id));
            edges.extend(edges_of(journal.state(), grid, id, position, &self.config.edges));
            before = id;
        }
        edges.insert(EdgeKey::new(before, chain.to));
        ops.extend(edges.into_iter().map(|edge| Op::PutEdge { edge }));
        ops
    }
}
