//! Parameters of an exploration, put together.

use crate::construct::{BuilderConfig, CoverageConfig, Hierarchy, RefinementConfig};
use crate::explore::{ExploreConfig, FrontierConfig};
use crate::slam::SlamConfig;
use crate::team::JoinConfig;
use fht_navigation::people::BystanderConfig;
use fht_perception::drivable_line::DrivableLineConfig;
use fht_worker::Pace;
use serde::{Deserialize, Serialize};

/// Parameters of an exploration.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MapperConfig {
    /// SLAM.
    pub slam: SlamConfig,
    /// Nodes, edges, rectangles.
    pub builder: BuilderConfig,
    /// Shortcuts.
    pub refine: RefinementConfig,
    /// Where to go.
    pub explore: ExploreConfig,
    /// Who walks about.
    pub people: BystanderConfig,
    /// Joining a map that exists.
    pub join: JoinConfig,
    /// Whether the loop waits for work beside it.
    pub pace: Pace,
}

impl MapperConfig {
    /// The paper's ablation "Main Only": no support nodes, longer edges, no refinement, no
    /// coverage; and no looks into gaps, which are too narrow for edges.
    #[must_use]
    pub fn main_only() -> Self {
        let edges = DrivableLineConfig { longest_m: 20.0, ..DrivableLineConfig::default() };
        let coverage = CoverageConfig::none();
        let builder = BuilderConfig { hierarchy: Hierarchy::MainOnly, edges, coverage, ..BuilderConfig::default() };
        let explore = ExploreConfig { frontier: FrontierConfig::without_gaps(), ..ExploreConfig::default() };
        let refine = RefinementConfig { max_shortcuts: 0, ..RefinementConfig::default() };
        Self { builder, refine, explore, ..Self::default() }
    }
}
