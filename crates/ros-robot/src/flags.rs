//! A robot that speaks ROS 2, on the command line.

use crate::config::RosRobotConfig;
use clap::Args;
use fht_ros::{KeyForm, NodeConfig};
use fht_ros_messages::Distribution;

/// How a robot's graph is reached, and which topics the robot has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "A robot that speaks ROS 2")]
pub struct GraphArgs {
    /// Which graph.
    #[command(flatten)]
    pub node: NodeArgs,
    /// Scans (sensor_msgs/LaserScan) [default: scan].
    #[arg(long, value_name = "TOPIC")]
    pub scan_topic: Option<String>,
    /// Odometry (nav_msgs/Odometry), or the topic of the transforms (tf) [default: odom].
    #[arg(long, value_name = "TOPIC")]
    pub odom_topic: Option<String>,
    /// Velocity commands (geometry_msgs/Twist or TwistStamped, as who takes them has it) [default:
    /// cmd_vel].
    #[arg(long, value_name = "TOPIC")]
    pub cmd_vel_topic: Option<String>,
    /// The robot's frame; by default what the odometry says.
    #[arg(long, value_name = "FRAME")]
    pub base_frame: Option<String>,
}

/// Which graph, and where on it.
#[derive(Clone, Debug, Args)]
pub struct NodeArgs {
    /// The robot's namespace, such as r1: its topics are /r1/scan and so on.
    #[arg(long, value_name = "NAME", default_value = "")]
    pub namespace: String,
    /// The robot's ROS_DOMAIN_ID.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=232))]
    pub domain: u32,
    /// How its router maps ROS names to keys: rmw (nodes with rmw_zenoh) or bridge
    /// (zenoh-bridge-ros2dds).
    #[arg(long, value_name = "FORM", default_value = "rmw")]
    pub ros_keys: KeyForm,
    /// Its distribution: humble, jazzy or kilted.
    #[arg(long, value_name = "NAME", default_value = "jazzy")]
    pub distribution: Distribution,
}

impl NodeArgs {
    /// The node called `name` of that graph.
    #[must_use]
    pub fn node(&self, name: &str) -> NodeConfig {
        NodeConfig {
            namespace: self.namespace.clone(),
            domain: self.domain,
            form: self.ros_keys,
            distribution: self.distribution,
            ..NodeConfig::new(name)
        }
    }
}

impl GraphArgs {
    /// These flags over what the file says.
    #[must_use]
    pub fn robot(&self, file: RosRobotConfig) -> RosRobotConfig {
        RosRobotConfig {
            scan: self.scan_topic.clone().unwrap_or(file.scan),
            odometry: self.odom_topic.clone().unwrap_or(file.odometry),
            cmd_vel: self.cmd_vel_topic.clone().unwrap_or(file.cmd_vel),
            base_frame: self.base_frame.clone().or(file.base_frame),
            ..file
        }
    }
}
