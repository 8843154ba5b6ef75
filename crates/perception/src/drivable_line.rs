//! Edges: straight lines that a robot can drive (paper, section III-B-3, equation 7).

use crate::grid::OccupancyGrid;
use crate::pose::{Point2, wrap_angle};
use fht_proto::{FixedPoint, Footprint, NodeId};
use serde::{Deserialize, Serialize};

/// Parameters of the edges.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct DrivableLineConfig {
    /// Longest edge, metres. Default 8 (the paper's).
    pub longest_m: f64,
    /// Every cell whose centre lies within this of an edge must be known to be free, metres.
    /// Default 0.165 ([`Footprint::edge_clearance_m`]): an occupied cell's centre is farther than
    /// that, and its nearest point farther than that less half a cell's diagonal (0.035 m for cells
    /// of 0.05 m), so 0.13 m are clear on either side: the radius of the paper's robot and half a
    /// cell, by which a corner of a wall may stand out of its occupied cells. Planners take edges
    /// to be that wide.
    pub half_width_m: f64,
    /// Of edges whose directions differ by less than this, only the shortest is kept, radians.
    /// Default 0.5 (nearest first, where the paper's code takes the newest first).
    pub bearing_gap_rad: f64,
    /// An existing edge is removed when something stands within this of it, metres. Less than the
    /// half width, so that a wall that wavers by a cell does not make edges come and go. Default
    /// 0.1.
    pub blocked_m: f64,
    /// The same for edges of nodes that other robots made, metres: their walls are off by a little
    /// from where this robot sees them. Default 0.05.
    pub blocked_told_m: f64,
}

impl DrivableLineConfig {
    /// For explorers of a footprint.
    #[must_use]
    pub fn of(footprint: &Footprint) -> Self {
        let half_width_m = footprint.edge_clearance_m();
        Self { longest_m: 8.0, half_width_m, bearing_gap_rad: 0.5, blocked_m: 0.1, blocked_told_m: 0.05 }
    }
}

impl Default for DrivableLineConfig {
    fn default() -> Self {
        Self::of(&Footprint::default())
    }
}

/// The nodes that can be reached from `here` in a straight line, of those given nearest first:
/// distance (metres), id, position.
#[must_use]
pub fn lines_to(
    grid: &OccupancyGrid,
    here: FixedPoint,
    nearest_first: impl IntoIterator<Item = (f64, NodeId, FixedPoint)>,
    config: &DrivableLineConfig,
) -> Vec<NodeId> {
    let point = |position: FixedPoint| Point2::new(position.x(), position.y());
    let mut bearings: Vec<f64> = Vec::new();
    let mut reached = Vec::new();
    for (_, other, position) in nearest_first {
        let bearing = (position.y() - here.y()).atan2(position.x() - here.x());
        let is_covered = bearings.iter().any(|&taken| wrap_angle(taken - bearing).abs() < config.bearing_gap_rad);
        if !is_covered && grid.is_corridor_free(point(here), point(position), config.half_width_m) {
            bearings.push(bearing);
            reached.push(other);
        }
    }
    reached
}
