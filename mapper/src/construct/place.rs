//! A place that the robot has seen, and where it lies on the grid.

use crate::slam::Anchored;
use fht_navigation::planning::{PlanConfig, UnknownCells};
use fht_perception::grid::OccupancyGrid;
use fht_perception::pose::Point2;
use fht_proto::{Descriptor, FixedPoint, ScanRecord};

/// What a node hangs on.
#[derive(Clone, Copy, Debug)]
pub struct Footing {
    /// Its pose in the frame of a keyframe.
    pub anchored: Anchored,
    /// The frame of the run at which it was seen, counted from 0; support nodes have none.
    pub frame: Option<u64>,
}

/// Position of a fixed point as the grid has it.
#[must_use]
pub fn point(position: FixedPoint) -> Point2 {
    Point2::new(position.x(), position.y())
}

/// What is free for a robot that keeps `half_width_m` on either side, unknown cells as walls. Half
/// a cell more than that: a path over cell centres is a little inexact.
#[must_use]
pub fn plan_config(half_width_m: f64, grid: &OccupancyGrid) -> PlanConfig {
    let robot_radius_m = half_width_m + 0.5 * grid.resolution_m();
    PlanConfig { robot_radius_m, unknown: UnknownCells::Obstacle, ..PlanConfig::shortest() }
}

/// What the cameras and the LiDAR said of one place.
#[derive(Clone, Debug)]
pub struct PlaceObservation {
    /// Where the robot was.
    pub anchored: Anchored,
    /// The frame of the run, counted from 0.
    pub frame: u64,
    /// The scan taken there.
    pub scan: ScanRecord,
    /// The descriptor of the panorama taken there, if there are cameras.
    pub descriptor: Option<Descriptor>,
    /// Its visual information, 0 to 1 (paper, equation 2, over its greatest value).
    pub information: f64,
}
