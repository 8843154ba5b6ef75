//! Parameters of the exploration, put together.

use super::division::DivisionConfig;
use super::frontier::FrontierConfig;
use super::setbacks::SetbackConfig;
use super::utility::UtilityConfig;
use crate::construct::RefinementConfig;
use fht_navigation::motion::{PathFollowerConfig, SafetyConfig};
use fht_navigation::people::DistanceConfig;
use fht_navigation::planning::PlanConfig;
use fht_proto::Footprint;
use serde::{Deserialize, Serialize};

/// How to explore.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct ExploreConfig {
    /// The planner's idea of the robot.
    pub plan: PlanConfig,
    /// Where the robot finds itself boxed in, it leaves with this distance from the centres of
    /// occupied cells, metres. Default 0.12.
    pub squeeze_m: f64,
    /// How paths are followed.
    pub follow: PathFollowerConfig,
    /// The check of every command against the scan.
    pub safety: SafetyConfig,
    /// The distance from people.
    pub distance: DistanceConfig,
    /// Standing for somebody is not being stuck, and a way that somebody blocks is waited for, for
    /// so long, seconds. Default 20.
    pub give_way_s: f64,
    /// What counts as a frontier.
    pub frontier: FrontierConfig,
    /// When no frontier is left, the robot looks again at floor that it has seen for a moment only,
    /// too short for a rectangle of the map, where so much of it hangs together, square metres.
    /// Default 0.1.
    pub min_half_seen_m2: f64,
    /// Terms of equation 1.
    pub utility: UtilityConfig,
    /// When a place is given up.
    pub setbacks: SetbackConfig,
    /// How work is divided among several explorers.
    pub team: DivisionConfig,
    /// Where the map lacks a link between what this robot and what others have seen. Default: the
    /// map's way is 1.5 times as long, and 2 m longer.
    pub links: RefinementConfig,
    /// At the start the robot stands and looks for so long, seconds: the map's frame is where it
    /// stands, and many scans tell better where that is than one. Default 2.
    pub first_look_s: f64,
    /// The path is checked against the grid this often, seconds. Default 1.
    pub check_period_s: f64,
    /// A new goal is chosen at most this often, seconds; until then the robot goes on along its
    /// path. Default 0.6.
    pub choose_period_s: f64,
    /// A goal is kept while this many frontier cells are near it. Default 4.
    pub goal_cells: usize,
    /// How near they must be, metres. Default 0.3.
    pub goal_radius_m: f64,
    /// How long to look around at a goal whose frontier does not vanish, seconds. Default 0.6.
    pub look_s: f64,
    /// Without moving for this long the robot is stuck, seconds. Default 6.
    pub stuck_after_s: f64,
}

impl Default for ExploreConfig {
    fn default() -> Self {
        Self {
            plan: PlanConfig::default(),
            squeeze_m: Footprint::default().squeeze_clearance_m(),
            follow: PathFollowerConfig::default(),
            safety: SafetyConfig::default(),
            distance: DistanceConfig::default(),
            give_way_s: 20.0,
            frontier: FrontierConfig::default(),
            min_half_seen_m2: 0.1,
            utility: UtilityConfig::default(),
            setbacks: SetbackConfig::default(),
            team: DivisionConfig::default(),
            links: RefinementConfig { saving_m: 2.0, ..RefinementConfig::default() },
            first_look_s: 2.0,
            check_period_s: 1.0,
            choose_period_s: 0.6,
            goal_cells: 4,
            goal_radius_m: 0.3,
            look_s: 0.6,
            stuck_after_s: 6.0,
        }
    }
}
