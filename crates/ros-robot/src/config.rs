//! Which topics and frames a robot has.

use fht_ros_frames::BandConfig;
use serde::{Deserialize, Serialize};

/// A robot's topics and frames, with the names that most ROS robots have. Topics without a leading
/// slash are in the robot's namespace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RosRobotConfig {
    /// Scans (sensor_msgs/LaserScan). Default scan.
    pub scan: String,
    /// Clouds of points (sensor_msgs/PointCloud2) that scans are made of, in place of `scan`.
    /// Default none.
    pub points: Option<String>,
    /// Which of their points count.
    pub band: BandConfig,
    /// Pictures of four cameras ahead, left, behind, right (sensor_msgs/Image or CompressedImage,
    /// which is also looked for at `NAME/compressed`), of 90° each, or with camera_info beside
    /// them and transforms. Default none: camera_front/image, camera_left/image, camera_back/image
    /// and camera_right/image, if all four are there.
    pub cameras: Option<[String; 4]>,
    /// Whether no pictures are read.
    // The program's own: it has a flag, and a section that all robots have.
    #[serde(skip)]
    pub without_cameras: bool,
    /// Odometry (nav_msgs/Odometry), or the topic of moving transforms, from which odom to base is
    /// taken then. Default odom.
    pub odometry: String,
    /// Moving transforms. Default tf.
    pub tf: String,
    /// Fixed transforms. Default tf_static.
    pub tf_static: String,
    /// Velocity commands. Default cmd_vel.
    pub cmd_vel: String,
    /// Whether others drive it, as Nav2 does: then it is not odd that they give commands.
    // The program's own, by who is to drive.
    #[serde(skip)]
    pub others_drive: bool,
    /// Whether the time is that of the topic `clock`: a simulation, or a bag that is played.
    /// Default false: this machine's.
    pub use_sim_time: bool,
    /// What tells the time then (rosgraph_msgs/Clock). Default /clock.
    pub clock: String,
    /// The robot's frame. Default none: what the odometry says.
    pub base_frame: Option<String>,
    /// The frame that odometry's transforms start from. Default odom.
    pub odom_frame: String,
    /// A sensor that says nothing for so long is silent: the robot stops, seconds. Default 0.35.
    pub silent_after_s: f64,
    /// How long a scan waits for its odometry, seconds; then it is late. Default 0.3.
    pub patience_s: f64,
    /// Most frames that wait while one is worked on; beyond that the oldest are lost. Default 1:
    /// who drives needs the newest. Who only listens loses nothing to a short delay with more.
    pub backlog: usize,
}

impl Default for RosRobotConfig {
    fn default() -> Self {
        Self {
            scan: "scan".to_owned(),
            points: None,
            band: BandConfig::default(),
            cameras: None,
            without_cameras: false,
            odometry: "odom".to_owned(),
            tf: "tf".to_owned(),
            tf_static: "tf_static".to_owned(),
            cmd_vel: "cmd_vel".to_owned(),
            others_drive: false,
            use_sim_time: false,
            clock: "/clock".to_owned(),
            base_frame: None,
            odom_frame: "odom".to_owned(),
            silent_after_s: 0.35,
            patience_s: 0.3,
            backlog: 1,
        }
    }
}

impl RosRobotConfig {
    /// The topic of what the robot sees, and its type.
    pub(crate) fn sight(&self) -> (&str, &'static str) {
        match &self.points {
            Some(points) => (points, "sensor_msgs/PointCloud2"),
            None => (&self.scan, "sensor_msgs/LaserScan"),
        }
    }

    /// Whether odometry comes from transforms.
    #[must_use]
    pub fn has_odometry_in_tf(&self) -> bool {
        self.odometry.trim_start_matches('/') == self.tf.trim_start_matches('/')
    }
}
