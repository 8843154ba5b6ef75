//! The way that a robot drove, as it is known by now.

use crate::mapping::Mapper;
use crate::slam::Anchored;
use fht_perception::pose::Pose2;

/// Distance between its points, metres.
const STEP_M: f64 = 0.1;

/// The way driven, a point every [`STEP_M`]. It moves with the map when that is corrected.
#[derive(Default)]
pub(super) struct WayDriven {
    points: Vec<(u64, Anchored)>,
}

impl WayDriven {
    /// After a frame: where the robot is.
    pub(super) fn follow(&mut self, mapper: &Mapper) {
        let Some(latest) = mapper.latest() else { return };
        let is_step = self.points.last().is_none_or(|(_, before)| {
            let way = mapper.locate(before).translation.vector - latest.map_from_base.translation.vector;
            way.norm() >= STEP_M
        });
        if is_step {
            self.points.push((latest.time_us, latest.anchored));
        }
    }

    /// Times, microseconds, and poses in the map frame.
    pub(super) fn poses<'a>(&'a self, mapper: &'a Mapper) -> impl Iterator<Item = (u64, Pose2)> + 'a {
        self.points.iter().map(|(time_us, anchored)| (*time_us, mapper.locate(anchored)))
    }
}
