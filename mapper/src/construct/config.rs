//! Parameters of the construction, put together.

use super::coverage::CoverageConfig;
use super::edges::DrivableLineConfig;
use super::selection::SelectionConfig;
use super::support::{Hierarchy, SupportConfig};
use fht_perception::free_rectangle::FreeRectangleConfig;
use serde::{Deserialize, Serialize};

/// Parameters of the construction.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct BuilderConfig {
    /// Sorts of nodes.
    pub hierarchy: Hierarchy,
    /// Main nodes.
    pub selection: SelectionConfig,
    /// Support nodes.
    pub support: SupportConfig,
    /// Edges.
    pub edges: DrivableLineConfig,
    /// Rectangles.
    pub free_space: FreeRectangleConfig,
    /// Free space that no rectangle covers.
    pub coverage: CoverageConfig,
    /// Nodes that others made.
    pub doubt: MapChangeConfig,
    /// People whom nodes' scans show.
    pub passers_by: PasserByConfig,
    /// When SLAM moves what a node hangs on, the node follows once it is off.
    pub follow: NodeCorrectionConfig,
}

/// When nodes follow corrections: every move is an increment to all robots, and millimetres help
/// none of them.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct NodeCorrectionConfig {
    /// Least move, metres. Default 0.005.
    pub least_m: f64,
    /// Least turn, radians. Default 0.002.
    pub least_rad: f64,
}

impl Default for NodeCorrectionConfig {
    fn default() -> Self {
        Self { least_m: 0.005, least_rad: 0.002 }
    }
}

/// When returns of a node's scan count as those of somebody who stood there.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct PasserByConfig {
    /// Nothing occupied may be within this of where the return ends, metres. Default 0.15.
    pub slack_m: f64,
    /// So many returns side by side must be gone. Default 2: one is a pole between beams.
    pub least_returns: usize,
    /// A scan of which more than this share is gone is left as it is: the map is what is wrong.
    /// Default 0.3.
    pub most_share: f64,
    /// At the end of a run a scan fits the map, whatever is gone, if at least this share of the
    /// returns that are left end at something. Default 0.9.
    pub fitting_share: f64,
    /// Of a scan that fits so much may be gone, as a share: people stood round the robot.
    /// Default 0.7.
    pub most_share_if_fitting: f64,
    /// What hangs together and stands alone, with nothing beside it that is nearer than this behind
    /// it, metres. Default 0.3.
    pub alone_m: f64,
    /// … may be somebody when it is at most this wide, metres. Default 0.6.
    pub widest_m: f64,
    /// … unless another node saw it so many frames before or after. Default 300 (a minute).
    pub apart_frames: u64,
}

impl Default for PasserByConfig {
    fn default() -> Self {
        Self {
            slack_m: 0.15,
            least_returns: 2,
            most_share: 0.3,
            fitting_share: 0.9,
            most_share_if_fitting: 0.7,
            alone_m: 0.3,
            widest_m: 0.6,
            apart_frames: 300,
        }
    }
}

/// When nodes of others are doubted.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct MapChangeConfig {
    /// Nodes within this of the robot are looked at, metres. Default 4.
    pub reach_m: f64,
    /// Every so many metres of driving. Default 0.5.
    pub every_m: f64,
    /// A node is judged again after so many metres of driving: that is another visit. Default 30.
    pub visit_m: f64,
    /// Others' walls may be off by this from where this robot sees them, metres: less is no
    /// contradiction. Default 0.1.
    pub slack_m: f64,
    /// A node to which no edge leads any more is within something if this robot sees something
    /// within so many metres of it, and not that its own place is free. Default 0.4.
    pub enclosed_m: f64,
    /// Returns of a node's scan that this robot must be able to judge. Default 60.
    pub least_returns: usize,
    /// A scan of which more than this share is no longer there is contradicted. Default 0.4.
    pub contradicted: f64,
    /// One of which less than this share is no longer there is confirmed. Default 0.15.
    pub confirmed: f64,
    /// Trust that a contradiction takes, percent. Default 40.
    pub loss: u8,
    /// Trust that a confirmation gives back, percent. Default 40.
    pub gain: u8,
    /// With less trust than this a node is retired, percent. Default 30.
    pub retired_below: u8,
}

impl Default for MapChangeConfig {
    fn default() -> Self {
        Self {
            reach_m: 4.0,
            every_m: 0.5,
            visit_m: 30.0,
            slack_m: 0.1,
            enclosed_m: 0.4,
            least_returns: 60,
            contradicted: 0.4,
            confirmed: 0.15,
            loss: 40,
            gain: 40,
            retired_below: 30,
        }
    }
}
