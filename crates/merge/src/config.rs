//! How maps are merged.

use crate::alignment::{CandidateConfig, DecideConfig, MatchConsensusConfig, PoseAlignmentConfig};
use crate::operations::{JointGridConfig, NodeSelectionConfig};
use fht_perception::drivable_line::DrivableLineConfig;
use fht_perception::evidence_grid::EvidenceConfig;
use fht_perception::matching::BranchAndBoundConfig;
use serde::{Deserialize, Serialize};

/// How maps are merged.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MergeConfig {
    /// Main nodes of a map, at most. Default 5,000.
    pub most_main_nodes: usize,
    /// Nodes of a map, at most. Default 100,000.
    pub most_nodes: usize,
    /// The search in a whole map.
    pub search: BranchAndBoundConfig,
    /// Places that are found.
    pub candidates: CandidateConfig,
    /// Which of them agree.
    pub agreement: MatchConsensusConfig,
    /// Making it exact.
    pub align: PoseAlignmentConfig,
    /// How beams are counted.
    pub evidence: EvidenceConfig,
    /// When it is believed.
    pub decide: DecideConfig,
    /// The joint grid.
    pub joint: JointGridConfig,
    /// Which nodes are taken over.
    pub keep: NodeSelectionConfig,
    /// New edges.
    pub edges: DrivableLineConfig,
}

impl Default for MergeConfig {
    fn default() -> Self {
        Self {
            most_main_nodes: 5_000,
            most_nodes: 100_000,
            search: BranchAndBoundConfig { points: 120, ..BranchAndBoundConfig::default() },
            candidates: CandidateConfig::default(),
            agreement: MatchConsensusConfig::default(),
            align: PoseAlignmentConfig::default(),
            evidence: EvidenceConfig::default(),
            decide: DecideConfig::default(),
            joint: JointGridConfig::default(),
            keep: NodeSelectionConfig::default(),
            edges: DrivableLineConfig::default(),
        }
    }
}
