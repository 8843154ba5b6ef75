//! Poses that others give on a robot's graph, in the map frame.

use fht_perception::pose::{Pose2, pose};
use fht_ros::{Qos, RosError, RosNode, Subscription};
use fht_ros_frames::{Mount, TransformTree, frame_name, yaw_of};
use fht_ros_messages::msg::{PoseStamped, TfMessage};
use std::sync::{Arc, Mutex, PoisonError};

/// Why a pose cannot be said in the map frame: a sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum UnknownFrame {
    #[error("the pose has a place or an orientation that is none")]
    NoPose,
    #[error(
        "no transform leads from map to {frame}: does the robot know its place (client-robot relocalize --ros, or \
         serve --ros)? frames there: {there}"
    )]
    NoTransform { frame: String, there: String },
}

/// What the robot's graph says of its frames.
pub(super) struct GraphFrames {
    tree: Mutex<TransformTree>,
}

impl GraphFrames {
    /// Listens to the topics of transforms, in tasks of the Tokio runtime that calls this.
    ///
    /// # Errors
    /// [`RosError`].
    pub(super) async fn listen(node: &RosNode, tf: &str, tf_static: &str) -> Result<Arc<Self>, RosError> {
        let transforms = node.subscribe::<TfMessage>(tf, Qos { depth: 100, ..Qos::sensor_data() }).await?;
        let fixed = node.subscribe::<TfMessage>(tf_static, Qos::latched(100)).await?;
        let frames = Arc::new(Self { tree: Mutex::default() });
        for heard in [transforms, fixed] {
            tokio::spawn(hear(heard, Arc::clone(&frames)));
        }
        Ok(frames)
    }

    /// A pose that somebody gave.
    ///
    /// # Errors
    /// [`UnknownFrame`].
    pub(super) fn in_map(&self, stamped: &PoseStamped) -> Result<Pose2, UnknownFrame> {
        let at = &stamped.pose;
        let is_place = at.position.x.is_finite() && at.position.y.is_finite();
        let yaw = yaw_of(&at.orientation).filter(|_| is_place).ok_or(UnknownFrame::NoPose)?;
        Ok(self.map_from(frame_name(&stamped.header.frame_id))? * pose(at.position.x, at.position.y, yaw))
    }

    /// Where a frame is in the map. One without a name is the map's.
    ///
    /// # Errors
    /// [`UnknownFrame::NoTransform`].
    pub(super) fn map_from(&self, frame: &str) -> Result<Pose2, UnknownFrame> {
        if frame.is_empty() || frame == "map" {
            return Ok(Pose2::identity());
        }
        let tree = self.tree.lock().unwrap_or_else(PoisonError::into_inner);
        match tree.base_from("map", frame) {
            Some(map_from_frame) => Ok(Mount::of(&map_from_frame).base_from_sensor),
            None => Err(UnknownFrame::NoTransform { frame: frame.to_owned(), there: tree.frames().join(", ") }),
        }
    }
}

async fn hear(transforms: Subscription<TfMessage>, frames: Arc<GraphFrames>) {
    loop {
        // What is no transform is passed over.
        let Ok(message) = transforms.next().await else { continue };
        let mut tree = frames.tree.lock().unwrap_or_else(PoisonError::into_inner);
        for stamped in &message.transforms {
            tree.insert(stamped);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_frames::{header_message, pose_message};
    use fht_ros_messages::msg::{Quaternion, TransformStamped};

    #[test]
    fn poses_of_any_frame_that_leads_to_the_map_are_taken() {
        let frames = GraphFrames { tree: Mutex::default() };
        let link = TransformStamped {
            header: header_message(1, "map"),
            child_frame_id: "odom".to_owned(),
            transform: pose_message(&pose(1.0, 2.0, 0.0)),
        };
        let in_odom = PoseStamped { header: header_message(1, "/odom"), pose: pose_message(&pose(3.0, 0.0, 0.5)) };
        assert!(frames.in_map(&in_odom).is_err_and(|error| error.to_string().contains("from map to odom")));
        frames.tree.lock().expect("nobody has it").insert(&link);
        let at = frames.in_map(&in_odom).expect("a transform leads there");
        assert!((at.translation.vector - nalgebra::Vector2::new(4.0, 2.0)).norm() < 1e-9, "{at}");
        let mut bad = PoseStamped { header: header_message(1, "map"), ..in_odom };
        bad.pose.position.x = f64::NAN;
        assert_eq!(frames.in_map(&bad), Err(UnknownFrame::NoPose));
        bad.pose.position.x = 0.0;
        bad.pose.orientation = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
        assert_eq!(frames.in_map(&bad), Err(UnknownFrame::NoPose));
    }
}
