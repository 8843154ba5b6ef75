//! `mapper explore --ros --drive nav2`: the mapper says what is to be seen, and Nav2 drives there.

use crate::run::{MappedFrame, MappingObserver};
use fht_perception::pose::{Point2, Pose2, pose};
use fht_ros_robot::Nav2Driver;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Tells Nav2 with each frame where to drive, if it drives at all.
pub(super) struct ExplorerGuide(pub(super) Option<Arc<Nav2Driver>>);

impl MappingObserver for ExplorerGuide {
    fn on_frame(&mut self, mapped: &MappedFrame<'_>) -> ControlFlow<()> {
        if let Some(driver) = &self.0 {
            driver.want(end_of(mapped.mapper.way_ahead()));
        }
        ControlFlow::Continue(())
    }
}

/// Where a way ends, heading as it comes there.
fn end_of(way: &[Point2]) -> Option<Pose2> {
    let (last, before) = way.split_last()?;
    let from = before.iter().rev().find(|point| **point != *last).unwrap_or(last);
    let heading = last - from;
    Some(pose(last.x, last.y, heading.y.atan2(heading.x)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_ends_where_it_leads() {
        let at = |x: f64, y: f64| Point2::new(x, y);
        assert_eq!(end_of(&[]), None);
        assert_eq!(end_of(&[at(1.0, 2.0)]), Some(pose(1.0, 2.0, 0.0)));
        let end = end_of(&[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 3.0), at(1.0, 3.0)]).expect("an end");
        assert!((end.rotation.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{end}");
    }
}
