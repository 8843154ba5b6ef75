//! What a robot's graph gets back: where the robot is, and what the floor is like, on the topics on
//! which slam_toolbox, AMCL and map_server publish them.
//!
//! A robot's loop hands over and goes on; a thread sends. Where the link takes no more, the newest
//! is dropped and the loop does not wait.

use crate::robot::OdomFrame;
use fht_perception::pose::Pose2;
use fht_proto::api::fleet::LocalizationState;
use fht_ros::{Publisher, Qos, RosError, RosNode};
use fht_ros_frames::{FloorGrid, grid_message, header_message, pose_message, update_message};
use fht_ros_messages::msg::{
    DiagnosticArray, DiagnosticStatus, KeyValue, OccupancyGridMsg, OccupancyGridUpdate, PathMsg, PoseArray,
    PoseStamped, PoseWithCovariance, PoseWithCovarianceStamped, TfMessage, TransformStamped,
};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::Duration;

/// How much may wait to be sent.
const WAITING: usize = 16;
/// How long the end of a run waits for what is still to be sent.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// What a place that is declared is off by, one standard deviation: metres along x and y, radians.
/// Recorded robots are off by 0.003 to 0.02 m and 0.1°, and what is drawn of a map is rounded to
/// its cells of 0.05 m.
const PLACE_SIGMA: (f64, f64) = (0.05, 0.02);

/// Who publishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputRole {
    /// A robot that makes a map: in the place of slam_toolbox.
    Mapping,
    /// A robot that finds its place in one: in the place of map_server and AMCL.
    Localization,
}

/// Where a robot is, as it knows at a frame.
#[derive(Clone, Debug)]
pub struct PlaceNow {
    /// The frame's time, microseconds since the epoch.
    pub time_us: u64,
    /// What it says of its place.
    pub state: LocalizationState,
    /// Probability that its place, or the likeliest, is right: 0 to 1.
    pub confidence: f64,
    /// Its pose by the odometry, as the frame has it.
    pub odom_from_base: Pose2,
    /// Its pose in the map frame, if it knows.
    pub map_from_base: Option<Pose2>,
    /// Where it may be while it does not know, map frame, likeliest first.
    pub candidates: Vec<Pose2>,
    /// Why it gave up the last place that it knew.
    pub lost_because: Option<String>,
}

/// What waits to be sent.
enum Output {
    Place(Box<PlaceNow>),
    Floor { time_us: u64, is_whole: bool, grid: Box<dyn FnOnce() -> FloorGrid + Send> },
    Way { time_us: u64, poses: Vec<(u64, Pose2)> },
}

/// Publishes what a robot knows on its own graph. What is there until it is dropped: its topics.
pub struct RosOutputs {
    sender: Option<SyncSender<Output>>,
    /// Hears that the thread has ended.
    ended: Receiver<()>,
}

impl RosOutputs {
    /// Publishes `map`, `map_updates`, `tf` and `path`, or `map`, `tf`, `amcl_pose`,
    /// `particle_cloud` and `/diagnostics`. The transform `map → odom` leads to `odom_frame`.
    ///
    /// # Errors
    /// [`RosError`] when the session is closed, or the system gives no thread.
    pub async fn start(node: &RosNode, role: OutputRole, odom_frame: OdomFrame) -> Result<Self, RosError> {
        let mut topics = Topics::declare(node, role, odom_frame).await?;
        let (sender, receiver) = sync_channel(WAITING);
        let (ends, ended) = sync_channel(1);
        let send = move || {
            while let Ok(output) = receiver.recv() {
                if let Err(error) = topics.send(output) {
                    tracing::debug!("{error}");
                }
            }
            let _ = ends.send(()); // whoever does not wait for it does not need it
        };
        std::thread::Builder::new().name("ros-outputs".to_owned()).spawn(send).map_err(RosError::Thread)?;
        Ok(Self { sender: Some(sender), ended })
    }

    fn give(&self, output: Output) {
        if let Some(sender) = &self.sender
            && sender.try_send(output).is_err()
        {
            tracing::debug!("the robot's router is slow: an output was dropped");
        }
    }

    /// Where the robot is.
    pub fn place(&self, now: PlaceNow) {
        self.give(Output::Place(Box::new(now)));
    }

    /// What the floor is like at `time_us`, microseconds since the epoch. `grid` is called in the
    /// thread that sends.
    pub fn floor(&self, time_us: u64, grid: impl FnOnce() -> FloorGrid + Send + 'static) {
        self.give(Output::Floor { time_us, is_whole: true, grid: Box::new(grid) });
    }

    /// The same, where what has changed since the last time is enough: all of it is told if the
    /// grid has other cells now.
    pub fn floor_changes(&self, time_us: u64, grid: impl FnOnce() -> FloorGrid + Send + 'static) {
        self.give(Output::Floor { time_us, is_whole: false, grid: Box::new(grid) });
    }

    /// The way driven: times, microseconds since the epoch, and poses in the map frame.
    pub fn way(&self, time_us: u64, poses: Vec<(u64, Pose2)>) {
        self.give(Output::Way { time_us, poses });
    }
}

/// What was handed over is sent first, if the link takes it in time.
impl Drop for RosOutputs {
    fn drop(&mut self) {
        self.sender = None;
        let _ = self.ended.recv_timeout(LAST_WORDS); // late is as well as never: the run has ended
    }
}

/// The topics of a role.
struct Topics {
    odom_frame: OdomFrame,
    floor: Publisher<OccupancyGridMsg>,
    /// What has changed of it, and what was told last.
    changes: Option<(Publisher<OccupancyGridUpdate>, Option<FloorGrid>)>,
    transforms: Publisher<TfMessage>,
    way: Option<Publisher<PathMsg>>,
    place: Option<PlaceTopics>,
}

struct PlaceTopics {
    pose: Publisher<PoseWithCovarianceStamped>,
    candidates: Publisher<PoseArray>,
    diagnostics: Publisher<DiagnosticArray>,
}

impl Topics {
    async fn declare(node: &RosNode, role: OutputRole, odom_frame: OdomFrame) -> Result<Self, RosError> {
        let (way, place) = match role {
            OutputRole::Mapping => (Some(node.publisher("path", Qos::latched(1)).await?), None),
            OutputRole::Localization => {
                let place = PlaceTopics {
                    pose: node.publisher("amcl_pose", Qos::latched(1)).await?,
                    candidates: node.publisher("particle_cloud", Qos::sensor_data()).await?,
                    diagnostics: node.publisher("/diagnostics", Qos::default()).await?,
                };
                (None, Some(place))
            }
        };
        let changes = match role {
            OutputRole::Mapping => Some((node.publisher("map_updates", Qos::default()).await?, None)),
            OutputRole::Localization => None,
        };
        let transforms = Qos { depth: 100, ..Qos::default() };
        Ok(Self {
            odom_frame,
            changes,
            floor: node.publisher("map", Qos::latched(1)).await?,
            transforms: node.publisher("tf", transforms).await?,
            way,
            place,
        })
    }

    fn send(&mut self, output: Output) -> Result<(), RosError> {
        match output {
            Output::Place(now) => self.send_place(&now),
            Output::Floor { time_us, is_whole, grid } => self.send_floor(time_us, is_whole, grid()),
            Output::Way { time_us, poses } => {
                let stamped = |(at_us, pose): (u64, Pose2)| PoseStamped {
                    header: header_message(at_us, "map"),
                    pose: pose_message(&pose),
                };
                let path =
                    PathMsg { header: header_message(time_us, "map"), poses: poses.into_iter().map(stamped).collect() };
                self.way.as_ref().map_or(Ok(()), |way| way.publish(&path))
            }
        }
    }

    fn send_floor(&mut self, time_us: u64, is_whole: bool, grid: FloorGrid) -> Result<(), RosError> {
        let Some((changes, told)) = &mut self.changes else { return self.floor.publish(&grid_message(time_us, &grid)) };
        let before = told.replace(grid.clone());
        match before.filter(|before| !is_whole && grid.has_cells_of(before)) {
            Some(before) => update_message(time_us, &before, &grid).map_or(Ok(()), |update| changes.publish(&update)),
            None => self.floor.publish(&grid_message(time_us, &grid)),
        }
    }

    fn send_place(&self, now: &PlaceNow) -> Result<(), RosError> {
        if let Some(map_from_base) = now.map_from_base {
            let map_from_odom = map_from_base * now.odom_from_base.inverse();
            let transform = TransformStamped {
                header: header_message(now.time_us, "map"),
                child_frame_id: self.odom_frame.name(),
                transform: pose_message(&map_from_odom),
            };
            self.transforms.publish(&TfMessage { transforms: vec![transform] })?;
        }
        let Some(topics) = &self.place else { return Ok(()) };
        if let Some(map_from_base) = now.map_from_base {
            topics.pose.publish(&PoseWithCovarianceStamped {
                header: header_message(now.time_us, "map"),
                pose: PoseWithCovariance { pose: pose_message(&map_from_base), covariance: covariance() },
            })?;
        }
        topics.candidates.publish(&PoseArray {
            header: header_message(now.time_us, "map"),
            poses: now.map_from_base.iter().chain(&now.candidates).map(pose_message).collect(),
        })?;
        topics.diagnostics.publish(&diagnostics(now))
    }
}

fn covariance() -> [[f64; 6]; 6] {
    let (metres, radians) = PLACE_SIGMA;
    let mut covariance = [[0.0; 6]; 6];
    (covariance[0][0], covariance[1][1]) = (metres * metres, metres * metres);
    covariance[5][5] = radians * radians;
    covariance
}

/// A robot that knows its place is well, one that is lost is not.
fn diagnostics(now: &PlaceNow) -> DiagnosticArray {
    let level = match now.state {
        LocalizationState::Localized => DiagnosticStatus::OK,
        LocalizationState::Lost => DiagnosticStatus::ERROR,
        LocalizationState::NotLocalized | LocalizationState::Candidates => DiagnosticStatus::WARN,
    };
    let value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
    let values = [
        Some(value("confidence", format!("{:.3}", now.confidence))),
        Some(value("candidates", now.candidates.len().to_string())),
        now.lost_because.clone().map(|reason| value("lost_because", reason)),
    ];
    let status = DiagnosticStatus {
        level,
        name: "localization".to_owned(),
        message: now.state.to_string(),
        hardware_id: String::new(),
        values: values.into_iter().flatten().collect(),
    };
    DiagnosticArray { header: header_message(now.time_us, ""), status: vec![status] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_perception::pose::pose;

    #[test]
    fn a_lost_robot_says_so_and_why() {
        let now = PlaceNow {
            time_us: 5,
            state: LocalizationState::Lost,
            confidence: 0.0,
            odom_from_base: pose(0.0, 0.0, 0.0),
            map_from_base: None,
            candidates: Vec::new(),
            lost_because: Some("the walls do not hold it".to_owned()),
        };
        let said = diagnostics(&now);
        let [status] = &said.status[..] else { panic!("{said:?}") };
        assert_eq!((status.level, status.message.as_str()), (DiagnosticStatus::ERROR, "LOST"));
        assert!(
            status.values.iter().any(|pair| pair.key == "lost_because" && pair.value.contains("walls")),
            "{said:?}"
        );
    }
}
