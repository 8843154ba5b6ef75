//! Parameters of the SLAM.

use super::closure::ClosureConfig;
use super::submap::SubmapConfig;
use crate::slam::calibration::OdometryNoise;
use fht_perception::grid::GridConfig;
use fht_perception::matching::MatchConfig;
use fht_perception::shared_view::SharedViewConfig;
use serde::{Deserialize, Serialize};

/// Parameters of the SLAM.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SlamConfig {
    /// The occupancy grid.
    pub grid: GridConfig,
    /// Scan matching of the front end.
    pub matching: MatchConfig,
    /// Submaps.
    pub submap: SubmapConfig,
    /// Loop closure.
    pub closure: ClosureConfig,
    /// What the wheels are believed to be.
    pub odometry: OdometryNoise,
    /// A keyframe is taken after this much driving, metres. Default 0.25.
    pub keyframe_distance_m: f64,
    /// A keyframe is taken after this much turning, radians. Default 0.5.
    pub keyframe_turn_rad: f64,
    /// Between keyframes, scans are averaged into the submaps after this much driving, metres.
    /// Default 0.08.
    pub average_distance_m: f64,
    /// Scans taken while the robot turned by more than this since the last one are not averaged in:
    /// they are drawn out by the turn. Radians. Default 0.05.
    pub average_turn_rad: f64,
    /// The grid shows a scan after this much driving, metres. Default 0.1.
    pub view_distance_m: f64,
    /// The grid shows a scan after this much turning, radians. Default 0.2.
    pub view_turn_rad: f64,
    /// A scan that explains less than this share of its points does not move the estimate: the
    /// wheels do. Default 0.3.
    pub min_score: f64,
    /// Share of the information of a wheels' edge that counts beside an edge of the scan: wheels
    /// err alike from one keyframe to the next. Default 0.3.
    pub odometry_trust: f64,
    /// A scan that explains less than this share is also searched for elsewhere: the wheels
    /// slipped. Default 0.6.
    pub good_score: f64,
    /// Half width of that search, metres. Default 0.5.
    pub rescue_m: f64,
    /// Half width of its headings, radians. Default 0.8.
    pub rescue_rad: f64,
    /// What that search finds must explain this share of the points more. Default 0.1.
    pub rescue_gain: f64,
    /// A scan that does not fit contradicts the submap when more than this share of its points lies
    /// where the submap saw free space. Default 0.3.
    pub lost_contradiction: f64,
    /// A scan that contradicts the map is held against those before it, where the wheels say: only
    /// if these are of different places is the robot's place in doubt.
    pub view: SharedViewConfig,
    /// A match that contradicts the map is believed when it is no farther from the wheels' word
    /// than this many of its standard deviations. Default 3.
    pub wheels_sigmas: f64,
    /// The robot is lost after driving this far while scans contradict, metres. Default 1.
    pub lost_after_m: f64,
    /// A robot that was not found again by then begins a new submap where the wheels say, metres.
    /// Default 30.
    pub give_up_m: f64,
    /// The same for one that fits nowhere in the whole map: so many searches in vain. Default 1.
    pub give_up_searches: usize,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            grid: GridConfig::default(),
            matching: MatchConfig { first_reach_m: 0.3, ..MatchConfig::default() },
            submap: SubmapConfig::default(),
            closure: ClosureConfig::default(),
            odometry: OdometryNoise::default(),
            keyframe_distance_m: 0.25,
            keyframe_turn_rad: 0.5,
            average_distance_m: 0.08,
            average_turn_rad: 0.05,
            view_distance_m: 0.1,
            view_turn_rad: 0.2,
            min_score: 0.3,
            odometry_trust: 0.3,
            good_score: 0.6,
            rescue_m: 0.5,
            rescue_rad: 0.8,
            rescue_gain: 0.1,
            lost_contradiction: 0.3,
            view: SharedViewConfig::default(),
            wheels_sigmas: 3.0,
            lost_after_m: 1.0,
            give_up_m: 30.0,
            give_up_searches: 1,
        }
    }
}
