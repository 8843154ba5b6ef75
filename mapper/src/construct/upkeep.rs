//! Nodes, edges and rectangles that are there already, kept true: they follow SLAM's corrections,
//! and what something stands in goes.

use super::edges::{blocked, edges_of, nearby_nodes};
use super::passers_by::{self, Sightings};
use super::{Builder, Footing, NodeCorrectionConfig, map_change};
use crate::publish::Journal;
use crate::slam::SlamEstimate;
use fht_map::NodeRef;
use fht_perception::free_rectangle;
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{from_fixed, to_fixed};
use fht_proto::{EdgeKey, FixedPoint, NodeId, NodeKind, Op, Rect};
use std::collections::{BTreeMap, BTreeSet};

/// Whether a rectangle around a node contains another around the same node, but for `slack_mm` on
/// each side: a node that followed a correction lies elsewhere in its cell.
fn contains(outer: &Rect, inner: &Rect, slack_mm: u16) -> bool {
    let reaches = |outer: u16, inner: u16| outer.saturating_add(slack_mm) >= inner;
    reaches(outer.west_mm, inner.west_mm)
        && reaches(outer.east_mm, inner.east_mm)
        && reaches(outer.south_mm, inner.south_mm)
        && reaches(outer.north_mm, inner.north_mm)
}

impl Builder {
    /// The rectangle of a node, if it is larger than what the map has by a tenth, or if something
    /// stands in what the map has; then whatever is free around the node by now, be it nothing.
    pub(super) fn free_space_op(&self, id: NodeId, journal: &Journal, grid: &OccupancyGrid) -> Option<Op> {
        let node = journal.state().node(id)?;
        let position = node.pose.position;
        if !self.is_own(id) {
            return map_change::free_space_op(&node, grid, &self.config.free_space, &self.config.doubt);
        }
        let grown = free_rectangle::grow(grid, position, &self.config.free_space);
        let is_news = match (node.free_space, grown) {
            (None, grown) => grown.is_some(),
            (Some(rect), _) if free_rectangle::is_obstructed(grid, position, &rect) => true,
            // A rectangle that reaches into a gap was grown from elsewhere, and is kept.
            (Some(rect), grown) => grown.is_some_and(|grown| {
                let cell_mm = (grid.resolution_m() * 1000.0) as u16;
                grown.area_m2() > 1.1 * rect.area_m2() && contains(&grown, &rect, cell_mm)
            }),
        };
        is_news.then_some(Op::SetFreeSpace { id, rect: grown })
    }

    /// Corrects the rectangles of the nodes around `here`, but for `done`, that something stands in
    /// by now: the robot has just seen this part, and others plan through what the map says is
    /// free.
    pub(super) fn corrections_near(
        &self,
        here: FixedPoint,
        done: Option<NodeId>,
        journal: &Journal,
        grid: &OccupancyGrid,
    ) -> Vec<Op> {
        let nodes = nearby_nodes(journal.state(), here, self.config.free_space.longest_reach_m);
        let is_wrong = |id: NodeId, position: FixedPoint| {
            let rect = journal.state().node(id).and_then(|node| node.free_space);
            self.is_own(id) && rect.is_some_and(|rect| free_rectangle::is_obstructed(grid, position, &rect))
        };
        let wrong = nodes.iter().filter(|&&(_, id, position)| done != Some(id) && is_wrong(id, position));
        let rectangles = wrong.filter_map(|(_, id, _)| self.free_space_op(*id, journal, grid));
        let own = nodes.iter().filter(|(_, id, _)| self.is_own(*id));
        let nodes = own.filter_map(|(_, id, _)| journal.state().node(*id));
        rectangles.chain(nodes.filter_map(|node| self.passers_by_op(&node, grid, false))).collect()
    }

    /// At the end, where people were about: what may be somebody is left out of the scans of this
    /// run's nodes.
    #[must_use]
    pub fn leave_out_doubtful(&self, journal: &Journal) -> Vec<Op> {
        let seen_at = |(id, footing): (&NodeId, &Footing)| Some((*id, footing.frame?));
        let frames: BTreeMap<NodeId, u64> = self.footings.iter().filter_map(seen_at).collect();
        let sightings = Sightings::of(journal.state().main_nodes(), &frames);
        let own = journal.state().main_nodes().filter_map(|node| Some((node.id, *frames.get(&node.id)?)));
        let nodes = own.filter_map(|(id, frame)| Some((journal.state().node(id)?, frame)));
        nodes.filter_map(|(node, frame)| sightings.without_doubtful(&node, frame, &self.config.passers_by)).collect()
    }

    /// The operation that takes people who have left out of a node's scan.
    fn passers_by_op(&self, node: &NodeRef<'_>, grid: &OccupancyGrid, is_end: bool) -> Option<Op> {
        self.has_people.then(|| passers_by::without_them(node, grid, is_end, &self.config.passers_by)).flatten()
    }

    /// Keyframes have moved: the operations that move nodes with them, and the nodes.
    pub fn follow(&mut self, journal: &Journal, estimate: &SlamEstimate<'_>) -> (Vec<Op>, BTreeSet<NodeId>) {
        let (mut ops, mut moved) = (Vec::new(), BTreeSet::new());
        for (id, footing) in &self.footings {
            let Some(node) = journal.state().node(*id) else { continue };
            let now = estimate.locate(&footing.anchored);
            let off = from_fixed(node.pose).inverse() * now;
            let NodeCorrectionConfig { least_m, least_rad } = self.config.follow;
            if off.translation.vector.norm() >= least_m || off.rotation.angle().abs() >= least_rad {
                let pose = to_fixed(&now);
                ops.push(Op::SetPose { id: *id, pose });
                moved.insert(*id);
                self.selection.moved(*id, pose.position);
            }
        }
        (ops, moved)
    }

    /// After nodes have `moved`, in a grid that was drawn again: their rectangles, and edges that
    /// now lead through walls. Those are removed, their ends get the edges that new nodes would
    /// get, and are returned for shortcuts to be looked for.
    #[must_use]
    pub fn mend(
        &self,
        moved: &BTreeSet<NodeId>,
        journal: &Journal,
        grid: &OccupancyGrid,
    ) -> (Vec<Op>, BTreeSet<NodeId>) {
        let state = journal.state();
        let there: BTreeSet<EdgeKey> = state.edges().collect();
        let blocked: BTreeSet<EdgeKey> =
            blocked(state, grid, |id| self.is_own(id), &self.config.edges).into_iter().collect();
        let cut: BTreeSet<NodeId> = blocked.iter().flat_map(|edge| [edge.low(), edge.high()]).collect();
        let mut joined: BTreeSet<EdgeKey> = BTreeSet::new();
        for id in &cut {
            let Some(node) = state.node(*id) else { continue };
            let edges = edges_of(state, grid, *id, node.pose.position, &self.config.edges);
            joined.extend(edges.into_iter().filter(|edge| !there.contains(edge)));
        }
        let removals = blocked.into_iter().map(|edge| Op::RemoveEdge { edge });
        let additions = joined.into_iter().map(|edge| Op::PutEdge { edge });
        let rectangles = moved.iter().filter_map(|id| self.free_space_op(*id, journal, grid));
        (removals.chain(additions).chain(rectangles).collect(), cut)
    }

    /// At the end: rectangles that have become larger since their node was made or that something
    /// stands in, edges that walls now cross, and this run's support nodes that no edge leads to
    /// any more: nobody could go by them, and what is free there is covered anew.
    #[must_use]
    pub fn finish(&self, journal: &Journal, grid: &OccupancyGrid) -> Vec<Op> {
        let state = journal.state();
        let blocked: BTreeSet<EdgeKey> =
            blocked(state, grid, |id| self.is_own(id), &self.config.edges).into_iter().collect();
        let is_left_alone = |id: NodeId| {
            let is_way = |other: NodeId| !blocked.contains(&EdgeKey::new(id, other));
            !state.neighbours(id).any(|other| is_way(other.id))
        };
        let is_alone =
            |node: &NodeRef<'_>| node.kind == NodeKind::Support && self.is_own(node.id) && is_left_alone(node.id);
        let (alone, kept): (Vec<_>, Vec<_>) = state.nodes().partition(is_alone);
        let alone = alone.into_iter().map(|node| Op::RemoveNode { id: node.id });
        let own = kept.iter().filter(|node| self.is_own(node.id));
        let scans: Vec<Op> = own.filter_map(|node| self.passers_by_op(node, grid, true)).collect();
        let rectangles = kept.into_iter().filter_map(|node| self.free_space_op(node.id, journal, grid));
        let removals = blocked.iter().map(|edge| Op::RemoveEdge { edge: *edge });
        removals.chain(alone).chain(rectangles).chain(scans).collect()
    }
}
