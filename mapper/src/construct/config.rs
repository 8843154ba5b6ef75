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
            least_returns: 60,
            contradicted: 0.4,
            confirmed: 0.15,
            loss: 40,
            gain: 40,
            retired_below: 30,
        }
    }
}
