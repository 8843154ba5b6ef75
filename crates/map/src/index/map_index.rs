//! Everything that finds things in one map, kept up with the map: the graph and its search index,
//! places, appearance.
//!
//! The index belongs to a [`MapState`] and is no part of it: digests and copies do not know it.
//! After applying increments to the map, pass them to [`MapIndex::follow`]. It looks up in the map
//! what they name, so increments that changed nothing, came twice or were late do no harm, and the
//! work is that of what has changed.
//!
//! The search index wears: after many changes it is still right, but searches visit more nodes than
//! they need to. Small maps rebuild it at once. Large ones say so ([`MapIndex::is_worn`]); the
//! caller then runs a [`SearchIndexJob`] on another thread and hands the result to
//! [`MapIndex::adopt`].

use crate::crdt::state::MapState;
use crate::graph::road_graph::{GraphShape, RoadGraph};
use crate::graph::search_index::{SearchIndex, SearchIndexConfig};
use crate::index::descriptors::DescriptorIndex;
use crate::index::spatial::Places;
use fht_proto::{EdgeKey, Increment, NodeId, NodeKind, Op};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// How an index is made.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct IndexConfig {
    /// Landmarks and cells.
    pub guide: SearchIndexConfig,
    /// Maps of up to so many nodes make a worn guide anew by themselves, within
    /// [`MapIndex::follow`]. Default 5000.
    pub rebuild_nodes: usize,
}

impl Default for IndexConfig {
    fn default() -> Self {
        Self { guide: SearchIndexConfig::default(), rebuild_nodes: 5000 }
    }
}

/// What finds things in one map.
#[derive(Clone, Debug)]
pub struct MapIndex {
    config: IndexConfig,
    roads: RoadGraph,
    guide: SearchIndex,
    places: Places,
    appearance: DescriptorIndex,
    /// What has changed since a job was given out: nodes by number.
    since_job: Option<BTreeSet<u32>>,
}

/// A guide to be made, on a copy of the roads.
#[derive(Clone, Debug)]
pub struct SearchIndexJob {
    shape: GraphShape,
    edges: usize,
    config: SearchIndexConfig,
}

impl SearchIndexJob {
    /// Makes it.
    #[must_use]
    pub fn run(self) -> SearchIndex {
        SearchIndex::of_shape(&self.shape, self.edges, self.config)
    }
}

impl MapIndex {
    /// The index of what `map` shows.
    #[must_use]
    pub fn new(map: &MapState, config: IndexConfig) -> Self {
        let roads = RoadGraph::of_map(map);
        let guide = SearchIndex::build(&roads, config.guide.clone());
        let spots = map.nodes().filter_map(|node| Some((roads.number(node.id)?, node.pose.position, node.free_space)));
        let places = Places::new(spots);
        Self { config, guide, places, appearance: DescriptorIndex::of_map(map), roads, since_job: None }
    }

    /// The graph.
    #[must_use]
    pub fn roads(&self) -> &RoadGraph {
        &self.roads
    }

    /// What guides searches over it.
    #[must_use]
    pub fn guide(&self) -> &SearchIndex {
        &self.guide
    }

    /// Where its nodes are.
    #[must_use]
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// What its main nodes look like.
    #[must_use]
    pub fn appearance(&self) -> &DescriptorIndex {
        &self.appearance
    }

    /// Brings the index up to `map`, to which `increments` were applied since it was. Every
    /// increment that changed the map must be among them; others may be.
    pub fn follow<'a>(&mut self, map: &MapState, increments: impl IntoIterator<Item = &'a Increment>) {
        self.follow_ops(map, increments.into_iter().flat_map(|increment| &increment.ops));
    }

    /// The same, told the operations: those of folds, too.
    pub fn follow_ops<'a>(&mut self, map: &MapState, ops: impl IntoIterator<Item = &'a Op>) {
        let (mut nodes, mut edges) = (BTreeSet::new(), BTreeSet::new());
        for op in ops {
            match op {
                Op::PutNode { id, .. }
                | Op::RemoveNode { id }
                | Op::SetPose { id, .. }
                | Op::SetFreeSpace { id, .. }
                | Op::SetSignature { id, .. } => _ = nodes.insert(*id),
                Op::PutEdge { edge } | Op::RemoveEdge { edge } => _ = edges.insert(*edge),
                // What is closed holds for each query anew.
                Op::PutModel { .. }
                | Op::SetTrust { .. }
                | Op::SetClosed { .. }
                | Op::SetPlace { .. }
                | Op::SetZone { .. }
                | Op::PutRelease { .. }
                | Op::RemoveRelease { .. }
                | Op::Enable { .. }
                | Op::SetFloorPlan { .. }
                | Op::SetDatum { .. } => {}
            }
        }
        for id in nodes {
            self.follow_node(map, id);
        }
        for edge in edges {
            self.follow_edge(map, edge);
        }
        if self.is_worn() && self.roads.nodes() <= self.config.rebuild_nodes {
            self.guide = SearchIndex::build(&self.roads, self.config.guide.clone());
        }
        self.guide.tidy(&self.roads);
    }

    fn note(&mut self, numbers: impl IntoIterator<Item = u32>) {
        if let Some(since_job) = &mut self.since_job {
            since_job.extend(numbers);
        }
    }

    fn follow_node(&mut self, map: &MapState, id: NodeId) {
        let shown = map.node(id);
        let main = shown.filter(|node| node.kind == NodeKind::Main);
        self.appearance.put(id, main.and_then(|node| node.descriptor()));
        let Some(node) = shown else { return self.remove_node(id) };
        let position = node.pose.position;
        let known = self.roads.number(id);
        let number = self.roads.put_node(id, position);
        if known.is_none() {
            self.guide.node_added(number);
            for other in map.neighbours(id).filter_map(|other| self.roads.number(other.id)).collect::<Vec<_>>() {
                self.put_edge(number, other);
            }
            self.note([number]);
        } else if self.places.get(number).is_none_or(|(before, _)| before != position) {
            for other in self.roads.steps(number).map(|(other, _)| other).collect::<Vec<_>>() {
                self.guide.edge_changed(&self.roads, number, other);
            }
            self.note([number]);
        }
        self.places.put(number, position, node.free_space);
    }

    fn remove_node(&mut self, id: NodeId) {
        let Some(number) = self.roads.number(id) else { return };
        let others = self.roads.remove_node(id);
        self.guide.node_removed(number, &others);
        self.places.remove(number);
        self.note(others.into_iter().chain([number]));
    }

    fn put_edge(&mut self, a: u32, b: u32) {
        if self.roads.put_edge(a, b) {
            self.guide.edge_changed(&self.roads, a, b);
            self.note([a, b]);
        }
    }

    fn follow_edge(&mut self, map: &MapState, edge: EdgeKey) {
        let Some((a, b)) = self.roads.number(edge.low()).zip(self.roads.number(edge.high())) else { return };
        if map.has_edge(edge) {
            self.put_edge(a, b);
        } else if self.roads.remove_edge(a, b) {
            self.guide.edge_removed(a, b);
            self.note([a, b]);
        }
    }

    /// Whether the guide should be made anew.
    #[must_use]
    pub fn is_worn(&self) -> bool {
        self.guide.is_worn()
    }

    /// What makes a guide anew without this index, which may change meanwhile. A job given out
    /// before counts no more.
    pub fn guide_job(&mut self) -> SearchIndexJob {
        self.since_job = Some(BTreeSet::new());
        let config = self.config.guide.clone();
        SearchIndexJob { shape: self.roads.shape().clone(), edges: self.roads.edges(), config }
    }

    /// Takes the guide of the last job, made right for what has changed meanwhile. Without a job it
    /// does nothing.
    pub fn adopt(&mut self, guide: SearchIndex) {
        let Some(changed) = self.since_job.take() else { return };
        self.guide = guide;
        // Each as if it were new, and then with its edges.
        for &number in &changed {
            self.guide.node_added(number);
        }
        for &number in &changed {
            for other in self.roads.steps(number).map(|(other, _)| other).collect::<Vec<_>>() {
                self.guide.edge_changed(&self.roads, number, other);
            }
        }
        self.guide.tidy(&self.roads);
    }
}
