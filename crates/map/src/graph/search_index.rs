//! What makes searches over a [`RoadGraph`] fast: landmarks, which give lower bounds, cells, which
//! are crossed in one step, and connected parts. It follows the changes of the graph. Searches with
//! it find ways as short as searches without it.

use crate::graph::alt::{AltLandmarks, LandmarksConfig};
use crate::graph::components::Parts;
use crate::graph::overlay_cells::{CellsConfig, OverlayCells};
use crate::graph::road_graph::{GraphShape, RoadGraph};
use serde::{Deserialize, Serialize};

/// How searches are guided.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SearchIndexConfig {
    /// Landmarks.
    pub landmarks: LandmarksConfig,
    /// Cells.
    pub cells: CellsConfig,
}

/// Landmarks, cells and parts of one graph.
#[derive(Clone, Debug)]
pub struct SearchIndex {
    config: SearchIndexConfig,
    landmarks: AltLandmarks,
    cells: OverlayCells,
    parts: Parts,
}

impl SearchIndex {
    /// Makes all of it: a score of searches over the whole graph.
    #[must_use]
    pub fn build(roads: &RoadGraph, config: SearchIndexConfig) -> Self {
        Self::of_shape(roads.shape(), roads.edges(), config)
    }

    pub(crate) fn of_shape(shape: &GraphShape, edges: usize, config: SearchIndexConfig) -> Self {
        let landmarks = AltLandmarks::build(shape, edges, config.landmarks.clone());
        let cells = OverlayCells::build(shape, &config.cells);
        Self { config, landmarks, cells, parts: Parts::build(shape) }
    }

    /// How it was made.
    #[must_use]
    pub fn config(&self) -> &SearchIndexConfig {
        &self.config
    }

    pub(crate) fn landmarks(&self) -> &AltLandmarks {
        &self.landmarks
    }

    pub(crate) fn cells(&self) -> &OverlayCells {
        &self.cells
    }

    pub(crate) fn parts(&self) -> &Parts {
        &self.parts
    }

    /// A number was given to a node, which has no edges yet.
    pub fn node_added(&mut self, node: u32) {
        self.landmarks.node_added(node);
        self.parts.node_added(node);
        self.cells.forget(node);
    }

    /// A node was taken away, and with it its edges to `others`.
    pub fn node_removed(&mut self, node: u32, others: &[u32]) {
        for &other in others {
            self.edge_removed(node, other);
        }
        self.cells.forget(node);
    }

    /// An edge was taken away.
    pub fn edge_removed(&mut self, a: u32, b: u32) {
        self.landmarks.edge_removed(a, b);
        self.cells.touch(a);
        self.cells.touch(b);
    }

    /// An edge was added, or has another length. `roads` has it already.
    pub fn edge_changed(&mut self, roads: &RoadGraph, a: u32, b: u32) {
        self.landmarks.edge_changed(roads.shape(), a, b);
        self.parts.join(a, b);
        self.cells.touch(a);
        self.cells.touch(b);
    }

    /// Measures the cells that changes have opened. Searches are right without it, and slower.
    pub fn tidy(&mut self, roads: &RoadGraph) {
        self.cells.tidy(roads.shape());
    }

    /// Whether so much has changed that searches would be faster with one built anew.
    #[must_use]
    pub fn is_worn(&self) -> bool {
        self.landmarks.are_worn()
    }

    /// How far it is at least between two nodes over edges, micrometres. 0 for numbers of no nodes.
    #[must_use]
    pub fn at_least_um(&self, roads: &RoadGraph, a: u32, b: u32) -> u64 {
        self.landmarks.at_least_um(roads.shape(), a, b)
    }

    /// Bytes on the heap: of the landmarks, and of cells and parts.
    #[must_use]
    pub fn bytes(&self) -> (usize, usize) {
        (self.landmarks.bytes(), self.cells.bytes() + self.parts.bytes())
    }
}
