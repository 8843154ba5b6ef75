//! Which topics and frames a robot has.

use serde::{Deserialize, Serialize};

/// A robot's topics and frames, with the names that most ROS robots have. Topics without a leading
/// slash are in the robot's namespace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct RosRobotConfig {
    /// Scans (sensor_msgs/LaserScan). Default scan.
    pub scan: String,
    /// Odometry (nav_msgs/Odometry), or the topic of moving transforms, from which odom to base is
    /// taken then. Default odom.
    pub odometry: String,
    /// Moving transforms. Default tf.
    pub tf: String,
    /// Fixed transforms. Default tf_static.
    pub tf_static: String,
    /// Velocity commands. Default cmd_vel.
    pub cmd_vel: String,
    /// The robot's frame. Default none: what the odometry says.
    pub base_frame: Option<String>,
    /// The frame that odometry's transforms start from. Default odom.
    pub odom_frame: String,
    /// A sensor that says nothing for so long is silent: the robot stops, seconds. Default 0.35.
    pub silent_after_s: f64,
    /// How long a scan waits for its odometry, seconds; then it is late. Default 0.3.
    pub patience_s: f64,
}

impl Default for RosRobotConfig {
    fn default() -> Self {
        Self {
            scan: "scan".to_owned(),
            odometry: "odom".to_owned(),
            tf: "tf".to_owned(),
            tf_static: "tf_static".to_owned(),
            cmd_vel: "cmd_vel".to_owned(),
            base_frame: None,
            odom_frame: "odom".to_owned(),
            silent_after_s: 0.35,
            patience_s: 0.3,
        }
    }
}

impl RosRobotConfig {
    /// Whether odometry comes from transforms.
    #[must_use]
    pub fn has_odometry_in_tf(&self) -> bool {
        self.odometry.trim_start_matches('/') == self.tf.trim_start_matches('/')
    }
}
