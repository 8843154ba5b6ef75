//! Parameters of the pilot, put together.

use super::final_turn::FinalTurnConfig;
use super::progress::ProgressConfig;
use crate::blockages::BlockageConfig;
use crate::path_following::PathFollowingConfig;
use fht_localization::localizer::LocalizerConfig;
use fht_navigation::disambiguation::DisambiguationConfig;
use fht_navigation::local_map::LocalMapConfig;
use fht_navigation::people::{BystanderConfig, DistanceConfig};
use fht_navigation::steering::SteeringConfig;
use fht_navigation::wandering::WanderingConfig;
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How a robot uses the map.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PilotConfig {
    /// Finding and keeping the place.
    pub localize: LocalizerConfig,
    /// The live grid.
    pub local_map: LocalMapConfig,
    /// Moving to what tells places apart.
    pub disambiguate: DisambiguationConfig,
    /// Moving about.
    pub wander: WanderingConfig,
    /// Following a path of the map.
    pub route: PathFollowingConfig,
    /// Driving.
    pub steering: SteeringConfig,
    /// Who walks about.
    pub people: BystanderConfig,
    /// The distance from people.
    pub distance: DistanceConfig,
    /// Standing for somebody is no want of progress for so long, seconds. Default 20.
    pub give_way_s: f64,
    /// Frames in a row without a way to the next point before what is in the way counts as blocked.
    /// Default 10 (2 s).
    pub blocked_after: usize,
    /// What is done about blocked places.
    pub blockages: BlockageConfig,
    /// When the robot does not get anywhere.
    pub progress: ProgressConfig,
    /// Turning to the goal's heading.
    pub final_turn: FinalTurnConfig,
    /// A goal that cannot be entered counts as reached this near to it, metres. Default 0.3.
    pub goal_slack_m: f64,
    /// Greatest distance driven without knowing the place, metres. Default 150.
    pub max_search_m: f64,
    /// Greatest time altogether, seconds of the sensors' clock. Default 1500.
    pub max_time_s: f64,
    /// Seed of the wandering.
    // A robot's own, given with the task.
    #[serde(skip)]
    pub seed: u64,
}

impl Default for PilotConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

impl PilotConfig {
    /// For a robot of a footprint. Its paths are asked for with the same one
    /// ([`ServerPathsConfig::footprint`](fht_client::ServerPathsConfig::footprint)).
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        Self {
            localize: LocalizerConfig::default(),
            local_map: LocalMapConfig::default(),
            disambiguate: DisambiguationConfig::of(footprint),
            wander: WanderingConfig::of(footprint),
            route: PathFollowingConfig::of(footprint),
            steering: SteeringConfig::of(footprint),
            people: BystanderConfig::default(),
            distance: DistanceConfig::of(footprint),
            give_way_s: 20.0,
            blocked_after: 10,
            blockages: BlockageConfig::default(),
            progress: ProgressConfig::default(),
            final_turn: FinalTurnConfig::default(),
            goal_slack_m: 0.3,
            max_search_m: 150.0,
            max_time_s: 1500.0,
            seed: 0,
        }
    }
}
