//! When a support node is needed (paper, section III-B-2).

use super::edges::{DrivableLineConfig, nearby_nodes};
use super::point;
use fht_map::MapState;
use fht_perception::grid::OccupancyGrid;
use fht_proto::FixedPoint;
use serde::{Deserialize, Serialize};

/// Parameters of the support nodes.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SupportConfig {
    /// th_s: a support node is made when no node is this near, metres. Default 2 (the paper's).
    #[cfg_attr(feature = "schema", schemars(range(min = 0.1, max = 100.0)))]
    pub spacing_m: f64,
}

impl Default for SupportConfig {
    fn default() -> Self {
        Self { spacing_m: 2.0 }
    }
}

/// Which sorts of nodes there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Hierarchy {
    /// Main nodes to relocalize by, support nodes to find ways by: the FHT-Map.
    #[default]
    MainAndSupport,
    /// Main nodes only (the paper's ablation "Main Only"): where no node could be reached any more
    /// in a straight line, a main node is made, joined to the one before if to no other.
    MainOnly,
}

/// Whether a place needs a support node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// It does not.
    None,
    /// The map has no node yet.
    Empty,
    /// Scenario 1 (equation 5): no straight line from any node to this place lies in free space.
    Connectivity,
    /// Scenario 2 (equation 6): every node is farther than th_s.
    Density,
}

/// Decides for the robot's place `here`.
#[must_use]
pub fn need(
    state: &MapState,
    grid: &OccupancyGrid,
    here: FixedPoint,
    config: &SupportConfig,
    edges: &DrivableLineConfig,
) -> Need {
    let nearby = nearby_nodes(state, here, edges.longest_m);
    let Some(&(nearest, ..)) = nearby.first() else {
        return if state.nodes().next().is_none() { Need::Empty } else { Need::Connectivity };
    };
    let is_reachable = |position: FixedPoint| grid.is_corridor_free(point(position), point(here), edges.half_width_m);
    if !nearby.iter().any(|&(_, _, position)| is_reachable(position)) {
        Need::Connectivity
    } else if nearest > config.spacing_m {
        Need::Density
    } else {
        Need::None
    }
}
