//! A robot that speaks ROS 2, on the command line.

use clap::{Args, Subcommand};
use fht_ros::{KeyForm, NodeConfig};
use fht_ros_messages::Distribution;
use fht_ros_robot::RosRobotConfig;

/// How a robot's graph is reached, and which topics the robot has.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "A robot that speaks ROS 2")]
pub(super) struct GraphArgs {
    /// The robot's namespace, such as r1: its topics are /r1/scan and so on.
    #[arg(long, value_name = "NAME", default_value = "")]
    pub(super) namespace: String,
    /// The robot's ROS_DOMAIN_ID.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=232))]
    domain: u32,
    /// How its router maps ROS names to keys: rmw (nodes with rmw_zenoh) or bridge
    /// (zenoh-bridge-ros2dds).
    #[arg(long, value_name = "FORM", default_value = "rmw")]
    ros_keys: KeyForm,
    /// Its distribution: humble, jazzy or kilted.
    #[arg(long, value_name = "NAME", default_value = "jazzy")]
    distribution: Distribution,
    /// Scans (sensor_msgs/LaserScan) [default: scan].
    #[arg(long, value_name = "TOPIC")]
    scan_topic: Option<String>,
    /// Odometry (nav_msgs/Odometry), or the topic of the transforms (tf) [default: odom].
    #[arg(long, value_name = "TOPIC")]
    odom_topic: Option<String>,
    /// Velocity commands (geometry_msgs/Twist or TwistStamped, as who takes them has it) [default:
    /// cmd_vel].
    #[arg(long, value_name = "TOPIC")]
    cmd_vel_topic: Option<String>,
    /// The robot's frame; by default what the odometry says.
    #[arg(long, value_name = "FRAME")]
    base_frame: Option<String>,
}

impl GraphArgs {
    pub(super) fn node(&self) -> NodeConfig {
        NodeConfig {
            namespace: self.namespace.clone(),
            domain: self.domain,
            form: self.ros_keys,
            distribution: self.distribution,
            ..NodeConfig::new("mapper")
        }
    }

    /// These flags over what the file says.
    pub(super) fn robot(&self, file: RosRobotConfig) -> RosRobotConfig {
        RosRobotConfig {
            scan: self.scan_topic.clone().unwrap_or(file.scan),
            odometry: self.odom_topic.clone().unwrap_or(file.odometry),
            cmd_vel: self.cmd_vel_topic.clone().unwrap_or(file.cmd_vel),
            base_frame: self.base_frame.clone().or(file.base_frame),
            ..file
        }
    }
}

#[derive(Debug, Subcommand)]
pub(super) enum RosCommand {
    /// Says what a robot's graph has of what mapping needs, and listens whether frames come.
    #[command(after_help = "Examples:
  mapper ros check tcp/robot:7447
  mapper ros check tcp/robot:7447 --namespace r1 --domain 3 --json

Exit code 0: all is there, and frames come; 1: something is missing; 2: wrong usage.")]
    Check(CheckArgs),
}

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    /// The robot's router, such as tcp/robot:7447.
    pub(super) endpoint: String,
    /// How long to wait for the router, and to listen, seconds each.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = fht_program::flags::seconds)]
    pub(super) wait: f64,
    /// Print JSON.
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    pub(super) graph: GraphArgs,
}
