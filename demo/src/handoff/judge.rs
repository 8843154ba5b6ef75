//! What a robot believes of its place, against the truth: both are said on its ROS graph.

use super::config::HandoffError;
use fht_perception::pose::{Pose2, pose};
use fht_ros::{NodeConfig, Qos, RosNode, Subscription};
use fht_ros_frames::{frame_name, yaw_of};
use fht_ros_messages::msg::{OdometryMsg, Pose, TfMessage};
use fht_session::SessionConfig;
use fht_sim::scoring::pose_error;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::runtime::Runtime;

/// Messages that may wait to be read.
const WAITING: usize = 4096;

/// What was said, by stamp, nanoseconds since the epoch.
#[derive(Default)]
struct Said {
    world_from_base: BTreeMap<u64, Pose2>,
    odom_from_base: BTreeMap<u64, Pose2>,
    map_from_odom: BTreeMap<u64, Pose2>,
}

/// Listens to `/ground_truth` and to the transforms `map → odom → base`.
pub(super) struct Judge {
    runtime: Runtime,
    said: Arc<Mutex<Said>>,
}

/// A robot's belief and the truth about it, map frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) truth: Pose2,
    /// What it believes; none while it does not know its place.
    pub(super) belief: Option<Pose2>,
}

fn plane(at: &Pose) -> Option<Pose2> {
    Some(pose(at.position.x, at.position.y, yaw_of(&at.orientation)?))
}

impl Judge {
    /// Listens at the robot's router.
    pub(super) fn start(endpoint: &str) -> Result<Self, HandoffError> {
        let runtime = fht_program::runtime(1)?;
        let said: Arc<Mutex<Said>> = Arc::default();
        runtime.block_on(async {
            let link = SessionConfig::from_options(vec![endpoint.to_owned()], None);
            let node = RosNode::join(fht_session::open(&link).await?, NodeConfig::new("judge")).await?;
            let qos = Qos { depth: WAITING, ..Qos::sensor_data() };
            let truth = node.subscribe::<OdometryMsg>("ground_truth", qos).await?;
            let transforms = node.subscribe::<TfMessage>("tf", qos).await?;
            tokio::spawn(hear_truth(truth, Arc::clone(&said)));
            tokio::spawn(hear_transforms(transforms, Arc::clone(&said)));
            Ok::<(), HandoffError>(())
        })?;
        Ok(Self { runtime, said })
    }

    /// All moments of which the truth was said, in the order of their times.
    pub(super) fn moments(self, world_from_map: &Pose2) -> Vec<Moment> {
        self.runtime.shutdown_background();
        let said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let map_from_world = world_from_map.inverse();
        let moments = said.world_from_base.iter().map(|(stamp, world_from_base)| {
            let transforms = said.map_from_odom.get(stamp).zip(said.odom_from_base.get(stamp));
            let belief = transforms.map(|(map_from_odom, odom_from_base)| map_from_odom * odom_from_base);
            Moment { truth: map_from_world * world_from_base, belief }
        });
        moments.collect()
    }
}

async fn hear_truth(truth: Subscription<OdometryMsg>, said: Arc<Mutex<Said>>) {
    loop {
        let Ok(odometry) = truth.next().await else { continue };
        if let (Some(stamp), Some(at)) = (odometry.header.stamp.nanoseconds(), plane(&odometry.pose.pose)) {
            said.lock().unwrap_or_else(PoisonError::into_inner).world_from_base.insert(stamp, at);
        }
    }
}

async fn hear_transforms(transforms: Subscription<TfMessage>, said: Arc<Mutex<Said>>) {
    loop {
        let Ok(message) = transforms.next().await else { continue };
        for stamped in &message.transforms {
            let (Some(stamp), Some(at)) = (stamped.header.stamp.nanoseconds(), plane(&stamped.transform)) else {
                continue;
            };
            let mut said = said.lock().unwrap_or_else(PoisonError::into_inner);
            match (frame_name(&stamped.header.frame_id), frame_name(&stamped.child_frame_id)) {
                ("map", "odom") => said.map_from_odom.insert(stamp, at),
                ("odom", _) => said.odom_from_base.insert(stamp, at),
                _ => None,
            };
        }
    }
}

/// Mean error of a robot's beliefs, metres.
pub(super) fn mean_error_m(moments: &[Moment]) -> f64 {
    let errors = moments.iter().filter_map(|moment| Some(pose_error(&moment.belief?, &moment.truth).0));
    let (sum, count) = errors.fold((0.0, 0_usize), |(sum, count), error| (sum + error, count + 1));
    sum / count.max(1) as f64
}

/// Distance truly driven over `moments`, metres.
pub(super) fn driven_m(moments: &[Moment]) -> f64 {
    let steps = moments.windows(2);
    steps.map(|pair| (pair[1].truth.translation.vector - pair[0].truth.translation.vector).norm()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_count_where_there_is_a_belief() {
        let moment = |x: f64, belief: Option<f64>| Moment {
            truth: pose(x, 0.0, 0.0),
            belief: belief.map(|x| pose(x, 0.0, 0.0)),
        };
        let moments = [moment(0.0, None), moment(1.0, Some(1.2)), moment(3.0, Some(3.0))];
        assert!((mean_error_m(&moments) - 0.1).abs() < 1e-9 && (driven_m(&moments) - 3.0).abs() < 1e-9);
        assert_eq!((mean_error_m(&[]), driven_m(&[])), (0.0, 0.0));
    }
}
