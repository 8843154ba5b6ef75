//! FHT-Map construction (paper, section III-B): which places become nodes, and what is kept of
//! them.
//!
//! | module | paper |
//! | --- | --- |
//! | `selection` | main nodes by visual information and density (equations 2 to 4) |
//! | `scan_coverage` | what of a scan the main nodes know (not in the paper) |
//! | `support` | the two rules for support nodes (equations 5 and 6) |
//! | `edges` | edges that lie in free space (equation 7) |
//! | `map_change` | others' nodes that are not as they say any more (not in the paper) |
//! | `passers_by` | people whom nodes' scans show (not in the paper) |
//! | `coverage` | support nodes for free space that no rectangle covers (not in the paper) |
//!
//! [`Builder`] puts them in the order of the paper's Algorithm 1. All of it is plain computation on
//! the explorer's own map and grid; what it decides comes out as operations.

mod config;
mod coverage;
mod covering;
mod edges;
mod map_change;
mod nodes;
mod passers_by;
mod place;
mod refinement;
mod scan_coverage;
mod selection;
mod support;
mod upkeep;

pub use config::{BuilderConfig, MapChangeConfig, NodeCorrectionConfig, PasserByConfig};
pub use coverage::CoverageConfig;
pub use edges::{blocked as blocked_edges, edges_of};
pub(crate) use nodes::Chain;
pub use place::{Footing, PlaceObservation};
pub(crate) use place::{plan_config, point};
pub use refinement::{RefinementConfig, Roadmap, Shortcut, shortcuts};
pub(crate) use refinement::{RefinementJob, grid_around, is_still_free, start as start_refinement};
pub use selection::SelectionConfig;
pub use support::{Hierarchy, Need, SupportConfig, need as need_of_support};

use crate::publish::Journal;
use crate::slam::{Anchored, SlamEstimate};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::{Pose2, to_fixed};
use fht_proto::{FixedPoint, NodeId, Op, ScanRecord};
use map_change::MapChange;
use selection::{SelectedPlace, Selection};
use std::collections::BTreeMap;

/// Turns places into nodes.
pub struct Builder {
    config: BuilderConfig,
    selection: Selection,
    /// The newest node, whose rectangle is grown when the next one is made.
    newest: Option<NodeId>,
    /// The last pose from which some node could be reached in a straight line.
    last_connected: Option<Anchored>,
    /// The last place seen from which some node could be reached, where all nodes are main nodes.
    last_place: Option<PlaceObservation>,
    footings: BTreeMap<NodeId, Footing>,
    /// Places along the way that may become main nodes at the end.
    passed: Vec<PlaceObservation>,
    /// What was found of nodes that others made.
    doubt: MapChange,
    /// Whether people walk about: where nobody does, no return is taken for somebody's.
    has_people: bool,
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
            doubt: MapChange::default(),
            has_people: false,
        }
    }

    /// People walk about: scans are looked at for those who stood and left.
    pub fn expect_people(&mut self) {
        self.has_people = true;
    }

    /// Whether this run made a node.
    #[must_use]
    pub fn is_own(&self, id: NodeId) -> bool {
        self.footings.contains_key(&id)
    }

    /// Another robot's main node is here now, or (`None`) no longer there.
    pub fn take_foreign_node(&mut self, id: NodeId, position: Option<FixedPoint>) {
        match position {
            Some(position) => self.selection.chose(id, position, self.config.selection.told_information),
            None => self.selection.lost(id),
        }
    }

    /// The robot is at `here`, having driven `odometer_m`: the operations for nodes around it that
    /// others made and that are not as they say.
    pub fn doubt(&mut self, here: FixedPoint, odometer_m: f64, journal: &Journal, grid: &OccupancyGrid) -> Vec<Op> {
        let Self { doubt, footings, config, .. } = self;
        doubt.look(here, odometer_m, journal.state(), grid, |id| footings.contains_key(&id), config)
    }

    /// Remembers a place while it is not known where in the map the robot is: at the end it may
    /// become a main node.
    pub fn remember(&mut self, observation: PlaceObservation) {
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

    /// The robot's cameras saw a place (some frames ago: the descriptor takes time). Returns the
    /// operations that make a main node of the best place seen lately, if it is time for one, and
    /// the node.
    pub fn observe_place(
        &mut self,
        observation: PlaceObservation,
        journal: &mut Journal,
        estimate: &SlamEstimate<'_>,
    ) -> Option<(NodeId, Vec<Op>)> {
        let position_of = |anchored: &Anchored| to_fixed(&estimate.locate(anchored)).position;
        let position = position_of(&observation.anchored);
        if self.config.hierarchy == Hierarchy::MainAndSupport
            && self.passed.last().is_none_or(|last| position_of(&last.anchored).distance(position) >= PASSED_EVERY_M)
        {
            self.passed.push(observation.clone());
        }
        let known = |seen: &PlaceObservation| {
            scan_coverage::known_share(journal.state(), &estimate.locate(&seen.anchored), &seen.scan)
        };
        let place = SelectedPlace { position, value: observation };
        let chosen = match self.config.hierarchy {
            Hierarchy::MainAndSupport => self.selection.observe(place, known)?,
            Hierarchy::MainOnly => self.observe_without_support(place, journal, estimate)?,
        };
        Some(self.make_main(chosen, journal, estimate))
    }

    /// At the end: the places passed that show walls which no main node knows.
    #[must_use]
    pub fn take_unknown(&mut self, journal: &Journal, estimate: &SlamEstimate<'_>) -> Vec<PlaceObservation> {
        let mut passed: Vec<Option<PlaceObservation>> =
            std::mem::take(&mut self.passed).into_iter().map(Option::Some).collect();
        let seen: Vec<(Pose2, &ScanRecord)> =
            passed.iter().flatten().map(|place| (estimate.locate(&place.anchored), &place.scan)).collect();
        let known = scan_coverage::ScanCoverage::of(journal.state(), FixedPoint::default(), f64::INFINITY);
        let telling = scan_coverage::most_telling(known, &seen, self.config.selection.least_news_m);
        telling.into_iter().filter_map(|index| passed[index].take()).collect()
    }

    /// Main nodes also hold the map together: where none can be reached any more, the last place
    /// from which one could be becomes a node.
    fn observe_without_support(
        &mut self,
        place: SelectedPlace,
        journal: &Journal,
        estimate: &SlamEstimate<'_>,
    ) -> Option<PlaceObservation> {
        let BuilderConfig { support, edges, .. } = &self.config;
        if support::need(journal.state(), estimate.grid, place.position, support, edges) == Need::Connectivity {
            return Some(self.last_place.take().unwrap_or(place.value));
        }
        self.last_place = Some(place.value.clone());
        self.selection.observe(place, |_| 1.0).inspect(|_| self.last_place = None)
    }

    /// The robot moved. Returns the operations that make a support node, if one is needed, and the
    /// node.
    pub fn observe_motion(
        &mut self,
        anchored: &Anchored,
        journal: &mut Journal,
        estimate: &SlamEstimate<'_>,
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
}

#[cfg(test)]
mod tests;
