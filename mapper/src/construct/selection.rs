//! Which places become main nodes (paper, section III-B-1).

use super::PlaceObservation;
use fht_proto::{FixedPoint, NodeId};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of the selection.
///
/// The paper gives its thresholds as symbols; its code weighs nodes by entropy in bits (about 3.3),
/// which leaves a window of 0.4 m to choose a place from. Here information is a share of its
/// greatest value, and the thresholds leave a window of about σ_c/2.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SelectionConfig {
    /// σ_c: how far a main node's relocalization capability reaches, metres. Default 2.65 (paper,
    /// section IV-A).
    pub sigma_c_m: f64,
    /// γ₁: below this capability places are considered. Default 0.57.
    pub gamma_1: f64,
    /// γ₂: below this capability the best place considered becomes a node. Default 0.25.
    pub gamma_2: f64,
    /// A place becomes a node, whatever its capability, when the main nodes know less than this
    /// share of what is seen from it
    /// (`scan_coverage::known_share`). Default 0.5: behind a wall,
    /// or where a room opens. Not in the paper.
    pub least_known: f64,
    /// At the end, places that were passed become nodes as long as one shows this much wall that no
    /// node knows, metres. Default 2. Not in the paper.
    pub least_news_m: f64,
    /// Visual information of nodes that other robots made, who do not tell it: a share of its
    /// greatest value. Default 0.85, about what panoramas of furnished rooms have.
    pub told_information: f64,
}

impl Default for SelectionConfig {
    fn default() -> Self {
        Self {
            sigma_c_m: 2.65,
            gamma_1: 0.57,
            gamma_2: 0.25,
            least_known: 0.5,
            least_news_m: 2.0,
            told_information: 0.85,
        }
    }
}

/// A place that might become a main node.
pub(super) struct SelectedPlace {
    pub position: FixedPoint,
    pub value: PlaceObservation,
}

/// The state of the selection: the nodes chosen, and the best place since capability fell below
/// γ₁.
pub(super) struct Selection {
    config: SelectionConfig,
    chosen: BTreeMap<NodeId, (FixedPoint, f64)>,
    best: Option<PlaceObservation>,
}

/// Relocalization capability C at `here` (paper, equation 3) from the main nodes' positions and
/// information.
#[must_use]
pub fn capability(nodes: impl Iterator<Item = (FixedPoint, f64)>, here: FixedPoint, config: &SelectionConfig) -> f64 {
    nodes
        .map(|(position, information)| information * (-(position.distance(here) / config.sigma_c_m).powi(2)).exp())
        .sum()
}

impl Selection {
    pub fn new(config: SelectionConfig) -> Self {
        Self { config, chosen: BTreeMap::new(), best: None }
    }

    /// Considers a place; returns the observation that becomes a node now, if any (paper, equation
    /// 4). `known` says which share of what is seen from it the nodes know.
    pub fn observe(
        &mut self,
        place: SelectedPlace,
        known: impl FnOnce(&PlaceObservation) -> f64,
    ) -> Option<PlaceObservation> {
        let capability = capability(self.chosen.values().copied(), place.position, &self.config);
        if capability >= self.config.gamma_2 && known(&place.value) < self.config.least_known {
            self.best = None;
            return Some(place.value);
        }
        if capability >= self.config.gamma_1 {
            self.best = None;
            return None;
        }
        let is_better = self.best.as_ref().is_none_or(|best| place.value.information > best.information);
        if is_better {
            self.best = Some(place.value);
        }
        if capability < self.config.gamma_2 { self.best.take() } else { None }
    }

    /// A node was moved.
    pub fn moved(&mut self, id: NodeId, position: FixedPoint) {
        if let Some(chosen) = self.chosen.get_mut(&id) {
            chosen.0 = position;
        }
    }

    /// A node is no longer there.
    pub fn lost(&mut self, id: NodeId) {
        self.chosen.remove(&id);
    }

    /// A node was made of a place.
    pub fn chose(&mut self, id: NodeId, position: FixedPoint, information: f64) {
        self.chosen.insert(id, (position, information));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slam::Anchored;
    use fht_perception::pose::{pose, to_fixed};
    use fht_proto::{AuthorId, ScanRecord};

    fn place(x: f64, information: f64) -> SelectedPlace {
        let map_from_base = pose(x, 0.0, 0.0);
        let scan = ScanRecord {
            base_from_sensor: to_fixed(&pose(0.0, 0.0, 0.0)),
            angle_min: 0.0,
            angle_increment: 0.1,
            ranges_mm: vec![1000; 60],
        };
        let anchored = Anchored { keyframe: 0, keyframe_from_base: map_from_base };
        let value = PlaceObservation { anchored, frame: 0, scan, descriptor: None, information };
        SelectedPlace { position: to_fixed(&map_from_base).position, value }
    }

    #[test]
    fn the_first_place_is_chosen_and_then_the_richest_of_a_window() {
        let mut selection = Selection::new(SelectionConfig::default());
        let mut chosen = Vec::new();
        for step in 0..60 {
            let x = f64::from(step) * 0.1;
            // A bright spot at 2.4 m, inside the window between γ₁ and γ₂.
            let information = if (x - 2.4).abs() < 0.05 { 0.95 } else { 0.8 };
            if let Some(best) = selection.observe(place(x, information), |_| 1.0) {
                let id = NodeId { author: AuthorId(1), number: chosen.len() as u32 };
                selection.chose(id, to_fixed(&best.anchored.keyframe_from_base).position, best.information);
                chosen.push(best.anchored.keyframe_from_base.translation.x);
            }
        }
        assert!(chosen.len() >= 2, "{chosen:?}");
        assert!(chosen[0].abs() < 1e-9, "{chosen:?}");
        assert!((chosen[1] - 2.4).abs() < 1e-9, "{chosen:?}");
    }

    #[test]
    fn a_place_that_the_nodes_know_little_of_is_chosen_at_once() {
        let mut selection = Selection::new(SelectionConfig::default());
        let id = NodeId { author: AuthorId(1), number: 0 };
        selection.chose(id, FixedPoint::from_metres(0.0, 0.0), 0.9);
        assert!(selection.observe(place(0.5, 0.9), |_| 0.7).is_none());
        let chosen = selection.observe(place(0.6, 0.9), |_| 0.4);
        assert!(chosen.is_some_and(|chosen| (chosen.anchored.keyframe_from_base.translation.x - 0.6).abs() < 1e-9));
    }

    #[test]
    fn capability_falls_with_distance_and_grows_with_information() {
        let config = SelectionConfig::default();
        let at = |x: f64| FixedPoint::from_metres(x, 0.0);
        let c = |x: f64, information: f64| capability([(at(0.0), information)].into_iter(), at(x), &config);
        assert!((c(0.0, 0.7) - 0.7).abs() < 1e-12);
        assert!(c(1.0, 0.7) > c(2.0, 0.7));
        assert!(c(2.0, 0.9) > c(2.0, 0.7));
        assert!((c(2.65, 1.0) - (-1.0_f64).exp()).abs() < 1e-9);
    }
}
