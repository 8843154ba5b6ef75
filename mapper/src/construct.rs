//! FHT-Map construction (paper, section III-B): which places become nodes, and what is kept of them.
//!
//! | module | paper |
//! | --- | --- |
//! | [`selection`] | main nodes by visual information and density (equations 2 to 4) |
//! | [`known`] | what of a scan the main nodes know (not in the paper) |
//! | [`support`] | the two rules for support nodes (equations 5 and 6) |
//! | [`edges`] | edges that lie in free space (equation 7) |
//! | [`doubt`] | nodes that others made and that are not as they say any more (not in the paper) |
//! | [`coverage`] | support nodes for free space that no rectangle covers (not in the paper) |
//!
//! [`Builder`] puts them in the order of the paper's Algorithm 1. All of it is plain computation on the explorer's own
//! map and grid; what it decides comes out as operations.

pub mod coverage;
pub mod doubt;
pub mod edges;
pub mod known;
pub mod selection;
pub mod support;

use crate::journal::Journal;
use crate::slam::{Anchored, Estimate};
use coverage::{CoverageConfig, Gaps, Goal, Patch};
use doubt::{Doubt, DoubtConfig};
use edges::EdgeConfig;
use fht_map::{MapState, NodeRef};
use fht_proto::{Descriptor, EdgeKey, FixedPoint, Increment, NodeId, NodeKind, Op, Rect, ScanRecord, Signature};
use fht_robot::free_space::{self, FreeSpaceConfig};
use fht_robot::grid::OccupancyGrid;
use fht_robot::planning::{PlanConfig, UnknownCells};
use fht_robot::pose::{Point2, Pose2, from_fixed, pose, to_fixed};
use selection::{Place, Selection, SelectionConfig};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use support::{Hierarchy, Need, SupportConfig};

/// Parameters of the construction.
#[derive(Clone, Debug, Default)]
pub struct BuilderConfig {
    /// Sorts of nodes.
    pub hierarchy: Hierarchy,
    /// Main nodes.
    pub selection: SelectionConfig,
    /// Support nodes.
    pub support: SupportConfig,
    /// Edges.
    pub edges: EdgeConfig,
    /// Rectangles.
    pub free_space: FreeSpaceConfig,
    /// Free space that no rectangle covers.
    pub coverage: CoverageConfig,
    /// Nodes that others made.
    pub doubt: DoubtConfig,
    /// When SLAM moves what a node hangs on, the node follows once it is off.
    pub follow: FollowConfig,
}

/// When nodes follow corrections: every move is an increment to all robots, and millimetres help none of them.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// Least move, metres. Default 0.005.
    pub least_m: f64,
    /// Least turn, radians. Default 0.002.
    pub least_rad: f64,
}

impl Default for FollowConfig {
    fn default() -> Self {
        Self { least_m: 0.005, least_rad: 0.002 }
    }
}

/// What a node hangs on.
#[derive(Clone, Copy, Debug)]
pub struct Footing {
    /// Its pose in the frame of a keyframe.
    pub anchored: Anchored,
    /// The frame of the run at which it was seen, counted from 0; support nodes have none.
    pub frame: Option<u64>,
}

/// Position of a fixed point as the grid has it.
#[must_use]
pub fn point(position: FixedPoint) -> Point2 {
    Point2::new(position.x(), position.y())
}

/// What is free for a robot that keeps `half_width_m` on either side, unknown cells as walls. Half a cell more than that: a
/// path over cell centres is a little inexact.
#[must_use]
pub fn plan_config(half_width_m: f64, grid: &OccupancyGrid) -> PlanConfig {
    let robot_radius_m = half_width_m + 0.5 * grid.resolution_m();
    PlanConfig { robot_radius_m, unknown: UnknownCells::Obstacle, ..PlanConfig::shortest() }
}

/// What the cameras and the LiDAR said of one place.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Where the robot was.
    pub anchored: Anchored,
    /// The frame of the run, counted from 0.
    pub frame: u64,
    /// The scan taken there.
    pub scan: ScanRecord,
    /// The descriptor of the panorama taken there, if there are cameras.
    pub descriptor: Option<Descriptor>,
    /// Its visual information, 0 to 1 (paper, equation 2, over its greatest value).
    pub information: f64,
}

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

/// Whether a rectangle around a node contains another around the same node, but for `slack_mm` on each side: a node that
/// followed a correction lies elsewhere in its cell.
fn contains(outer: &Rect, inner: &Rect, slack_mm: u16) -> bool {
    let reaches = |outer: u16, inner: u16| outer.saturating_add(slack_mm) >= inner;
    reaches(outer.west_mm, inner.west_mm)
        && reaches(outer.east_mm, inner.east_mm)
        && reaches(outer.south_mm, inner.south_mm)
        && reaches(outer.north_mm, inner.north_mm)
}

/// Turns places into nodes.
pub struct Builder {
    config: BuilderConfig,
    selection: Selection,
    /// The newest node, whose rectangle is grown when the next one is made.
    newest: Option<NodeId>,
    /// The last pose from which some node could be reached in a straight line.
    last_connected: Option<Anchored>,
    /// The last place seen from which some node could be reached, where all nodes are main nodes.
    last_place: Option<Observation>,
    footings: BTreeMap<NodeId, Footing>,
    /// Places along the way that may become main nodes at the end.
    passed: Vec<Observation>,
    /// What was found of nodes that others made.
    doubt: Doubt,
}

/// Distance of the places that are remembered, metres.
const PASSED_EVERY_M: f64 = 0.5;

impl Builder {
    /// Before the first node.
    #[must_use]
    pub fn new(config: BuilderConfig) -> Self {
        Self {
            selection: Selection::new(config.selection.clone()),
            config,
            newest: None,
            last_connected: None,
            last_place: None,
            footings: BTreeMap::new(),
            passed: Vec::new(),
            doubt: Doubt::default(),
        }
    }

    /// Whether this run made a node.
    #[must_use]
    pub fn is_own(&self, id: NodeId) -> bool {
        self.footings.contains_key(&id)
    }

    /// Another robot's main node is here now, or (`None`) no longer there.
    pub fn tell(&mut self, id: NodeId, position: Option<FixedPoint>) {
        match position {
            Some(position) => self.selection.chose(id, position, self.config.selection.told_information),
            None => self.selection.lost(id),
        }
    }

    /// The robot is at `here`, having driven `odometer_m`: the operations for nodes around it that others made and that are not as they say.
    pub fn doubt(&mut self, here: FixedPoint, odometer_m: f64, journal: &Journal, grid: &OccupancyGrid) -> Vec<Op> {
        let Self { doubt, footings, config, .. } = self;
        doubt.look(here, odometer_m, journal.state(), grid, |id| footings.contains_key(&id), config)
    }

    /// Remembers a place while it is not known where in the map the robot is: at the end it may become a main node.
    pub fn remember(&mut self, observation: Observation) {
        self.passed.push(observation);
    }

    /// The parameters.
    #[must_use]
    pub fn config(&self) -> &BuilderConfig {
        &self.config
    }

    /// What the nodes hang on.
    #[must_use]
    pub fn footings(&self) -> &BTreeMap<NodeId, Footing> {
        &self.footings
    }

    /// The robot's cameras saw a place (some frames ago: the descriptor takes time). Returns the operations that make
    /// a main node of the best place seen lately, if it is time for one, and the node.
    pub fn observe_place(
        &mut self,
        observation: Observation,
        journal: &mut Journal,
        estimate: &Estimate<'_>,
    ) -> Option<(NodeId, Vec<Op>)> {
        let position_of = |anchored: &Anchored| to_fixed(&estimate.locate(anchored)).position;
        let position = position_of(&observation.anchored);
        if self.config.hierarchy == Hierarchy::MainAndSupport
            && self.passed.last().is_none_or(|last| position_of(&last.anchored).distance(position) >= PASSED_EVERY_M)
        {
            self.passed.push(observation.clone());
        }
        let known =
            |seen: &Observation| known::known_share(journal.state(), &estimate.locate(&seen.anchored), &seen.scan);
        let place = Place { position, value: observation };
        let chosen = match self.config.hierarchy {
            Hierarchy::MainAndSupport => self.selection.observe(place, known)?,
            Hierarchy::MainOnly => self.observe_without_support(place, journal, estimate)?,
        };
        Some(self.make_main(chosen, journal, estimate))
    }

    /// At the end: the places passed that show walls which no main node knows.
    #[must_use]
    pub fn take_unknown(&mut self, journal: &Journal, estimate: &Estimate<'_>) -> Vec<Observation> {
        let mut passed: Vec<Option<Observation>> =
            std::mem::take(&mut self.passed).into_iter().map(Option::Some).collect();
        let seen: Vec<(Pose2, &ScanRecord)> =
            passed.iter().flatten().map(|place| (estimate.locate(&place.anchored), &place.scan)).collect();
        let known = known::Known::of(journal.state(), FixedPoint::default(), f64::INFINITY);
        let telling = known::most_telling(known, &seen, self.config.selection.least_news_m);
        telling.into_iter().filter_map(|index| passed[index].take()).collect()
    }

    /// The operations that make a main node of a place, and the node.
    pub fn make_main(
        &mut self,
        chosen: Observation,
        journal: &mut Journal,
        estimate: &Estimate<'_>,
    ) -> (NodeId, Vec<Op>) {
        let position = to_fixed(&estimate.locate(&chosen.anchored)).position;
        let signature = Signature { descriptor: chosen.descriptor, scan: chosen.scan };
        let footing = Footing { anchored: chosen.anchored, frame: Some(chosen.frame) };
        let made = self.make_node(footing, Some(signature), journal, estimate);
        self.selection.chose(made.0, position, chosen.information);
        made
    }

    /// Main nodes also hold the map together: where none can be reached any more, the last place from which one could be
    /// becomes a node.
    fn observe_without_support(
        &mut self,
        place: Place,
        journal: &Journal,
        estimate: &Estimate<'_>,
    ) -> Option<Observation> {
        let BuilderConfig { support, edges, .. } = &self.config;
        if support::need(journal.state(), estimate.grid, place.position, support, edges) == Need::Connectivity {
            return Some(self.last_place.take().unwrap_or(place.value));
        }
        self.last_place = Some(place.value.clone());
        self.selection.observe(place, |_| 1.0).inspect(|_| self.last_place = None)
    }

    /// The robot moved. Returns the operations that make a support node, if one is needed, and the node.
    pub fn observe_motion(
        &mut self,
        anchored: &Anchored,
        journal: &mut Journal,
        estimate: &Estimate<'_>,
    ) -> Option<(NodeId, Vec<Op>)> {
        if self.config.hierarchy == Hierarchy::MainOnly {
            return None;
        }
        let here = to_fixed(&estimate.locate(anchored)).position;
        let need = support::need(journal.state(), estimate.grid, here, &self.config.support, &self.config.edges);
        let mut make = |builder: &mut Self, anchored| {
            builder.make_node(Footing { anchored, frame: None }, None, journal, estimate)
        };
        match need {
            Need::None => {
                self.last_connected = Some(*anchored);
                None
            }
            // Nothing is in the map yet: the first main node starts it.
            Need::Empty => None,
            Need::Density => {
                self.last_connected = Some(*anchored);
                Some(make(self, *anchored))
            }
            // One step ago some node could still be reached: a node there keeps the map connected.
            Need::Connectivity => {
                let place = self.last_connected.take()?;
                Some(make(self, place))
            }
        }
    }

    fn make_node(
        &mut self,
        footing: Footing,
        signature: Option<Signature>,
        journal: &mut Journal,
        estimate: &Estimate<'_>,
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
        let edges = edges::edges_of(journal.state(), grid, id, pose.position, &self.config.edges);
        let previous = self.newest.replace(id);
        let is_alone = edges.is_empty() && self.config.hierarchy == Hierarchy::MainOnly;
        let by_way_driven = previous.filter(|_| is_alone).map(|previous| EdgeKey::new(previous, id));
        ops.extend(edges.into_iter().chain(by_way_driven).map(|edge| Op::PutEdge { edge }));
        ops.extend(previous.and_then(|previous| self.free_space_op(previous, journal, grid)));
        ops.extend(self.corrections_near(pose.position, previous, journal, grid));
        (id, ops)
    }

    /// A support node at a place where the robot need not have been: it hangs on the nearest keyframe.
    fn put_support(&mut self, id: NodeId, place: Point2, estimate: &Estimate<'_>) -> Op {
        let map_from_place = pose(place.x, place.y, 0.0);
        self.footings.insert(id, Footing { anchored: estimate.anchor(&map_from_place), frame: None });
        Op::PutNode { id, kind: NodeKind::Support, pose: to_fixed(&map_from_place) }
    }

    /// The operations that join two nodes by support nodes in between (a shortcut). Each new node also gets the edges
    /// that any new node gets.
    pub fn make_chain(&mut self, chain: &Chain<'_>, journal: &mut Journal, estimate: &Estimate<'_>) -> Vec<Op> {
        let grid = estimate.grid;
        let mut ops = Vec::new();
        let mut edges = BTreeSet::new();
        let mut before = chain.from;
        for place in chain.between {
            let id = journal.fresh_node();
            let position = FixedPoint::from_metres(place.x, place.y);
            ops.push(self.put_support(id, *place, estimate));
            let rect = free_space::grow(grid, position, &self.config.free_space);
            ops.extend(rect.map(|rect| Op::SetFreeSpace { id, rect: Some(rect) }));
            edges.insert(EdgeKey::new(before, id));
            edges.extend(edges::edges_of(journal.state(), grid, id, position, &self.config.edges));
            before = id;
        }
        edges.insert(EdgeKey::new(before, chain.to));
        ops.extend(edges.into_iter().map(|edge| Op::PutEdge { edge }));
        ops
    }

    /// The rectangle of a node, if it is larger than what the map has by a tenth, or if something stands in what the map
    /// has; then whatever is free around the node by now, be it nothing.
    fn free_space_op(&self, id: NodeId, journal: &Journal, grid: &OccupancyGrid) -> Option<Op> {
        let node = journal.state().node(id)?;
        let position = node.pose.position;
        if !self.is_own(id) {
            return doubt::free_space_op(&node, grid, &self.config.free_space, &self.config.doubt);
        }
        let grown = free_space::grow(grid, position, &self.config.free_space);
        let is_news = match (node.free_space, grown) {
            (None, grown) => grown.is_some(),
            (Some(rect), _) if free_space::is_obstructed(grid, position, &rect) => true,
            // A rectangle that reaches into a gap was grown from elsewhere, and is kept.
            (Some(rect), grown) => grown.is_some_and(|grown| {
                let cell_mm = (grid.resolution_m() * 1000.0) as u16;
                grown.area_m2() > 1.1 * rect.area_m2() && contains(&grown, &rect, cell_mm)
            }),
        };
        is_news.then_some(Op::SetFreeSpace { id, rect: grown })
    }

    /// Corrects the rectangles of the nodes around `here`, but for `done`, that something stands in by now: the robot has
    /// just seen this part, and others plan through what the map says is free.
    fn corrections_near(
        &self,
        here: FixedPoint,
        done: Option<NodeId>,
        journal: &Journal,
        grid: &OccupancyGrid,
    ) -> Vec<Op> {
        let nodes = edges::nearby_nodes(journal.state(), here, self.config.free_space.longest_reach_m);
        let is_wrong = |id: NodeId, position: FixedPoint| {
            let rect = journal.state().node(id).and_then(|node| node.free_space);
            self.is_own(id) && rect.is_some_and(|rect| free_space::is_obstructed(grid, position, &rect))
        };
        let wrong = nodes.into_iter().filter(|&(_, id, position)| done != Some(id) && is_wrong(id, position));
        wrong.filter_map(|(_, id, _)| self.free_space_op(id, journal, grid)).collect()
    }

    /// Keyframes have moved: the operations that move nodes with them, and the nodes.
    pub fn follow(&mut self, journal: &Journal, estimate: &Estimate<'_>) -> (Vec<Op>, BTreeSet<NodeId>) {
        let (mut ops, mut moved) = (Vec::new(), BTreeSet::new());
        for (id, footing) in &self.footings {
            let Some(node) = journal.state().node(*id) else { continue };
            let now = estimate.locate(&footing.anchored);
            let off = from_fixed(node.pose).inverse() * now;
            let FollowConfig { least_m, least_rad } = self.config.follow;
            if off.translation.vector.norm() >= least_m || off.rotation.angle().abs() >= least_rad {
                let pose = to_fixed(&now);
                ops.push(Op::SetPose { id: *id, pose });
                moved.insert(*id);
                self.selection.moved(*id, pose.position);
            }
        }
        (ops, moved)
    }

    /// After nodes have `moved`, in a grid that was drawn again: their rectangles, and edges that now lead through walls.
    /// Those are removed, their ends get the edges that new nodes would get, and are returned for shortcuts to be looked for.
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
            edges::blocked(state, grid, |id| self.is_own(id), &self.config.edges).into_iter().collect();
        let cut: BTreeSet<NodeId> = blocked.iter().flat_map(|edge| [edge.low(), edge.high()]).collect();
        let mut joined: BTreeSet<EdgeKey> = BTreeSet::new();
        for id in &cut {
            let Some(node) = state.node(*id) else { continue };
            let edges = edges::edges_of(state, grid, *id, node.pose.position, &self.config.edges);
            joined.extend(edges.into_iter().filter(|edge| !there.contains(edge)));
        }
        let removals = blocked.into_iter().map(|edge| Op::RemoveEdge { edge });
        let additions = joined.into_iter().map(|edge| Op::PutEdge { edge });
        let rectangles = moved.iter().filter_map(|id| self.free_space_op(*id, journal, grid));
        (removals.chain(additions).chain(rectangles).collect(), cut)
    }

    /// Support nodes for free space that no rectangle covers, with their edges.
    pub fn cover(&mut self, journal: &mut Journal, estimate: &Estimate<'_>) -> Vec<Op> {
        // The map as it will be: a new node may have an edge to one that was new before it.
        let mut map = journal.state().clone();
        let mut all = Vec::new();
        for goal in [Goal::Centre, Goal::Ground] {
            let mut gaps = Gaps::of(&map, estimate.grid, &self.config.free_space, &self.config.coverage, goal);
            // Places from which no edge leads to any node that there is yet.
            let mut hopeless: HashSet<FixedPoint> = HashSet::new();
            while let Some(patch) = gaps.take_best() {
                let id = journal.next_node();
                let joined = self.joined(&patch, goal, id, &map, estimate.grid, &mut hopeless);
                let Some((Patch { place, rect }, mut edges)) = joined else {
                    continue; // nobody could get there
                };
                let id = journal.fresh_node();
                edges.truncate(self.config.coverage.most_edges);
                hopeless.retain(|other| other.distance(place) > self.config.edges.longest_m);
                gaps.cover(&patch);
                let put = self.put_support(id, point(place), estimate);
                let ops = [put, Op::SetFreeSpace { id, rect: Some(rect) }].into_iter();
                let ops: Vec<Op> = ops.chain(edges.into_iter().map(|edge| Op::PutEdge { edge })).collect();
                let (author, hlc_us) = (journal.author(), map.max_hlc_us() + 1);
                map.apply(&Increment { author, number: u64::MAX, hlc_us, ops: ops.clone() });
                all.extend(ops);
            }
        }
        all
    }

    /// A patch with a node that has edges. In a gap too narrow for an edge it stands as near to it as the rectangle allows.
    fn joined(
        &self,
        patch: &Patch,
        goal: Goal,
        id: NodeId,
        map: &MapState,
        grid: &OccupancyGrid,
        hopeless: &mut HashSet<FixedPoint>,
    ) -> Option<(Patch, Vec<EdgeKey>)> {
        let places = match goal {
            Goal::Centre => vec![patch.place],
            Goal::Ground => patch.places(grid),
        };
        places.into_iter().find_map(|place| {
            if hopeless.contains(&place) {
                return None;
            }
            let edges = edges::edges_of(map, grid, id, place, &self.config.edges);
            if edges.is_empty() {
                hopeless.insert(place);
            }
            (!edges.is_empty()).then(|| (patch.seen_from(place), edges))
        })
    }

    /// At the end: rectangles that have become larger since their node was made or that something stands in, edges that walls now cross, and
    /// this run's support nodes that no edge leads to any more: nobody could go by them, and what is free there is covered anew.
    #[must_use]
    pub fn finish(&self, journal: &Journal, grid: &OccupancyGrid) -> Vec<Op> {
        let state = journal.state();
        let blocked: BTreeSet<EdgeKey> =
            edges::blocked(state, grid, |id| self.is_own(id), &self.config.edges).into_iter().collect();
        let is_left_alone = |id: NodeId| {
            let is_way = |other: NodeId| !blocked.contains(&EdgeKey::new(id, other));
            !state.neighbours(id).any(|other| is_way(other.id))
        };
        let is_alone =
            |node: &NodeRef<'_>| node.kind == NodeKind::Support && self.is_own(node.id) && is_left_alone(node.id);
        let (alone, kept): (Vec<_>, Vec<_>) = state.nodes().partition(is_alone);
        let alone = alone.into_iter().map(|node| Op::RemoveNode { id: node.id });
        let rectangles = kept.into_iter().filter_map(|node| self.free_space_op(node.id, journal, grid));
        let removals = blocked.iter().map(|edge| Op::RemoveEdge { edge: *edge });
        removals.chain(alone).chain(rectangles).collect()
    }
}

#[cfg(test)]
mod tests;
