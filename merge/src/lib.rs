//! Two maps of one building, made apart, become one.
//!
//! | module | idea |
//! | --- | --- |
//! | `side` | a map as it is compared |
//! | [`candidates`] | place recognition: where in the other map could this have been seen? |
//! | [`agreement`] | which matches say the same |
//! | [`align`] | the pose graph: one map bent so that its places lie on their matches |
//! | `evidence` | what each map's scans say in the other |
//! | [`decide`] | is it one building, and is this how the maps lie? |
//! | [`alignment`] | all of these: where the second map lies in the first |
//! | [`joint`] | both maps on one grid |
//! | `coverage` | which ground rectangles cover |
//! | [`keep`] | which nodes of the second map are of use |
//! | `join` | how they hang together, and on the first map |
//! | `rules` | places and zones |
//! | [`joined`] | all of these: the operations that bring the second map into the first |
//! | [`refusal`] | why two maps are not merged |
//!
//! Plain computation over two [`MapState`](fht_map::MapState)s: no network, no clock, no chance. The same maps give the same operations.

pub mod agreement;
pub mod align;
pub mod alignment;
pub mod candidates;
mod coverage;
pub mod decide;
mod evidence;
mod join;
pub mod joined;
pub mod joint;
pub mod keep;
pub mod refusal;
mod rules;
mod side;

pub use alignment::{Alignment, AlignmentFigures, lay};
pub use joined::{JoinFigures, Joined, Order, join};
pub use refusal::Refusal;

use agreement::AgreementConfig;
use align::AlignConfig;
use candidates::CandidateConfig;
use decide::DecideConfig;
use fht_robot::edges::EdgeConfig;
use fht_robot::known_space::EvidenceConfig;
use fht_robot::matching::EverywhereConfig;
use joint::JointConfig;
use keep::KeepConfig;

/// How maps are merged.
#[derive(Clone, Debug)]
pub struct MergeConfig {
    /// Main nodes of a map, at most. Default 5,000.
    pub most_main_nodes: usize,
    /// Nodes of a map, at most. Default 100,000.
    pub most_nodes: usize,
    /// The search in a whole map.
    pub search: EverywhereConfig,
    /// Places that are found.
    pub candidates: CandidateConfig,
    /// Which of them agree.
    pub agreement: AgreementConfig,
    /// Making it exact.
    pub align: AlignConfig,
    /// How beams are counted.
    pub evidence: EvidenceConfig,
    /// When it is believed.
    pub decide: DecideConfig,
    /// The joint grid.
    pub joint: JointConfig,
    /// Which nodes are taken over.
    pub keep: KeepConfig,
    /// New edges.
    pub edges: EdgeConfig,
}

impl Default for MergeConfig {
    fn default() -> Self {
        Self {
            most_main_nodes: 5_000,
            most_nodes: 100_000,
            search: EverywhereConfig { points: 120, ..EverywhereConfig::default() },
            candidates: CandidateConfig::default(),
            agreement: AgreementConfig::default(),
            align: AlignConfig::default(),
            evidence: EvidenceConfig::default(),
            decide: DecideConfig::default(),
            joint: JointConfig::default(),
            keep: KeepConfig::default(),
            edges: EdgeConfig::default(),
        }
    }
}
