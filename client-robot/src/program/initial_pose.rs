//! `initialpose`, where RViz puts where a person thinks that the robot is: looked at, and believed
//! only if the scans say so.

use crate::mission::MissionObserver;
use crate::pilot::{Pilot, PilotStep};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Pose2, pose};
use fht_ros::{Qos, RosError, RosNode, Subscription};
use fht_ros_frames::{frame_name, yaw_of};
use fht_ros_messages::msg::PoseWithCovarianceStamped;
use std::ops::ControlFlow;

const TOPIC: &str = "initialpose";

/// Hears where people say that the robot is.
pub(super) struct InitialPose(Subscription<PoseWithCovarianceStamped>);

impl InitialPose {
    /// Listens on the robot's graph.
    ///
    /// # Errors
    /// [`RosError`].
    pub(super) async fn listen(node: &RosNode) -> Result<Self, RosError> {
        Ok(Self(node.subscribe(TOPIC, Qos { depth: 1, ..Qos::default() }).await?))
    }
}

/// The place that was meant; or why there is none, as a sentence.
fn meant(topic: &str, said: &PoseWithCovarianceStamped) -> Result<Pose2, String> {
    let frame = frame_name(&said.header.frame_id);
    if !frame.is_empty() && frame != "map" {
        return Err(format!("{topic} is told in frame {frame}: tell it in frame map (RViz: Fixed Frame)"));
    }
    let at = &said.pose.pose;
    match yaw_of(&at.orientation) {
        Some(yaw) if at.position.x.is_finite() && at.position.y.is_finite() => {
            Ok(pose(at.position.x, at.position.y, yaw))
        }
        _ => Err(format!("{topic} has a pose that is none")),
    }
}

impl MissionObserver for InitialPose {
    fn on_frame(&mut self, _: &SensorFrame, _: &PilotStep, _: &Pilot) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn pointed_at(&mut self) -> Option<Pose2> {
        let said = self.0.take_raw()?;
        let topic = self.0.topic();
        let meant = match said.decode::<PoseWithCovarianceStamped>() {
            Ok(said) => meant(topic, &said),
            Err(error) => Err(format!("{topic} has a message that cannot be read: {error}")),
        };
        meant.map_err(|sentence| tracing::warn!("{sentence}")).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_frames::{header_message, pose_message};

    #[test]
    fn places_are_told_in_the_map_frame() {
        let mut said = PoseWithCovarianceStamped { header: header_message(1, "map"), ..Default::default() };
        said.pose.pose = pose_message(&pose(1.0, 2.0, 0.5));
        assert_eq!(meant("/initialpose", &said), Ok(pose(1.0, 2.0, 0.5)));
        said.header = header_message(1, "odom");
        assert!(meant("/initialpose", &said).is_err_and(|why| why.contains("/initialpose is told in frame odom")));
        said.header = header_message(1, "/map");
        said.pose.pose.position.x = f64::INFINITY;
        assert!(meant("/initialpose", &said).is_err_and(|why| why.contains("none")));
    }
}
