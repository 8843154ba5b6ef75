//! A robot that speaks ROS 2, on the command line.

use crate::config::RosRobotConfig;
use clap::Args;
use fht_ros::{KeyForm, NodeConfig};
use fht_ros_frames::BandConfig;
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
    /// Clouds of points (sensor_msgs/PointCloud2: a 3D LiDAR, a depth camera) that scans are made
    /// of, in place of --scan-topic.
    #[arg(long, value_name = "TOPIC", conflicts_with = "scan_topic")]
    pub points: Option<String>,
    /// Points between these heights over the robot's frame count, metres [default: 0.1,0.6].
    #[arg(long, value_name = "LOW,HIGH", value_parser = band, allow_hyphen_values = true)]
    pub band: Option<(f64, f64)>,
    /// Directions all round that scans of points have [default: 720].
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(8..=7200))]
    pub beams: Option<u16>,
    /// Pictures of four cameras of 90° each (sensor_msgs/Image or CompressedImage, also at
    /// NAME/compressed); cameras of other angles need camera_info and transforms [default:
    /// camera_front/image and so on with left, back and right, if all four are there].
    #[arg(long, value_name = "AHEAD,LEFT,BEHIND,RIGHT", value_parser = four)]
    pub cameras: Option<FourTopics>,
    /// Odometry (nav_msgs/Odometry), or the topic of the transforms (tf) [default: odom].
    #[arg(long, value_name = "TOPIC")]
    pub odom_topic: Option<String>,
    /// Velocity commands (geometry_msgs/Twist or TwistStamped, as who takes them has it) [default:
    /// cmd_vel].
    #[arg(long, value_name = "TOPIC")]
    pub cmd_vel_topic: Option<String>,
    /// The time is that of /clock, as of a simulation, or a bag that is played with --clock; stamps
    /// are judged by it.
    #[arg(long)]
    pub use_sim_time: bool,
    /// The robot's frame; by default what the odometry says.
    #[arg(long, value_name = "FRAME")]
    pub base_frame: Option<String>,
}

/// Which graph, and where on it.
#[derive(Clone, Debug, Args)]
pub struct NodeArgs {
    /// The robot's namespace, such as r1: its topics are /r1/scan and so on.
    #[arg(long, value_name = "NAME", default_value = "", value_parser = fht_ros::namespace)]
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

/// A flag of a robot that speaks ROS 2 was given to another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} is for a robot that speaks ROS 2: say which with --ros")]
pub struct OnlyWithRos(pub &'static str);

impl GraphArgs {
    /// Checks that none of these flags says something: they are of no use to a robot that speaks no
    /// ROS 2.
    ///
    /// # Errors
    /// [`OnlyWithRos`], the first one.
    pub fn check_none_given(&self) -> Result<(), OnlyWithRos> {
        let NodeArgs { namespace, domain, ros_keys, distribution } = &self.node;
        let flags = [
            ("--namespace", !namespace.is_empty()),
            ("--domain", *domain != 0),
            ("--ros-keys", *ros_keys != KeyForm::default()),
            ("--distribution", *distribution != Distribution::default()),
            ("--scan-topic", self.scan_topic.is_some()),
            ("--points", self.points.is_some()),
            ("--band", self.band.is_some()),
            ("--beams", self.beams.is_some()),
            ("--cameras", self.cameras.is_some()),
            ("--odom-topic", self.odom_topic.is_some()),
            ("--cmd-vel-topic", self.cmd_vel_topic.is_some()),
            ("--use-sim-time", self.use_sim_time),
            ("--base-frame", self.base_frame.is_some()),
        ];
        let given = flags.into_iter().find_map(|(flag, is_given)| is_given.then_some(flag));
        given.map_or(Ok(()), |flag| Err(OnlyWithRos(flag)))
    }

    /// These flags over what the file says.
    #[must_use]
    pub fn robot(&self, file: RosRobotConfig) -> RosRobotConfig {
        let (low_m, high_m) = self.band.unwrap_or((file.band.low_m, file.band.high_m));
        let beams = self.beams.map_or(file.band.beams, usize::from);
        RosRobotConfig {
            // A topic of scans on the command line goes before clouds of the file.
            points: self.points.clone().or(file.points.filter(|_| self.scan_topic.is_none())),
            band: BandConfig { low_m, high_m, beams, ..file.band },
            cameras: self.cameras.clone().map(|FourTopics(topics)| topics).or(file.cameras),
            scan: self.scan_topic.clone().unwrap_or(file.scan),
            odometry: self.odom_topic.clone().unwrap_or(file.odometry),
            cmd_vel: self.cmd_vel_topic.clone().unwrap_or(file.cmd_vel),
            use_sim_time: self.use_sim_time || file.use_sim_time,
            base_frame: self.base_frame.clone().or(file.base_frame),
            ..file
        }
    }
}

/// The topics of four cameras: ahead, left, behind, right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FourTopics(pub [String; 4]);

fn four(text: &str) -> Result<FourTopics, String> {
    let topics: Vec<String> = text.split(',').map(|topic| topic.trim().to_owned()).collect();
    let is_named = topics.iter().all(|topic| !topic.is_empty());
    let topics = <[String; 4]>::try_from(topics).ok().filter(|_| is_named);
    topics.map(FourTopics).ok_or_else(|| "give four topics: ahead, left, behind, right".to_owned())
}

/// Two heights, metres, the lower one first.
fn band(text: &str) -> Result<(f64, f64), String> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|metres| metres.abs() <= 100.0);
    let band = text.split_once(',').and_then(|(low, high)| number(low).zip(number(high)));
    band.filter(|(low, high)| low < high)
        .ok_or_else(|| "give two heights in metres, the lower one first, such as 0.1,0.6".to_owned())
}

#[cfg(test)]
mod tests {
    use super::{GraphArgs, OnlyWithRos, band, four};
    use clap::Parser;

    #[derive(Parser)]
    struct Program {
        #[command(flatten)]
        graph: GraphArgs,
    }

    #[test]
    fn what_only_a_robot_with_ros_has_is_noticed() {
        let check = |flags: &[&str]| {
            let given = ["program"].iter().chain(flags);
            Program::try_parse_from(given).map_err(|error| error.to_string()).map(|of| of.graph.check_none_given())
        };
        assert_eq!(check(&[]), Ok(Ok(())));
        assert_eq!(check(&["--namespace", "r1", "--odom-topic", "tf"]), Ok(Err(OnlyWithRos("--namespace"))));
        assert!(check(&["--namespace", "a//b"]).is_err_and(|said| said.contains("has an empty part")));
        for flags in
            [&["--domain", "3"][..], &["--ros-keys", "bridge"], &["--distribution", "humble"], &["--use-sim-time"]]
        {
            assert!(matches!(check(flags), Ok(Err(OnlyWithRos(flag))) if flag == flags[0]), "{flags:?}");
        }
    }

    #[test]
    fn cameras_are_four() {
        let topics = four("a/image, b/image,c,d").map(|topics| topics.0);
        assert_eq!(topics, Ok(["a/image", "b/image", "c", "d"].map(str::to_owned)));
        for bad in ["", "a,b,c", "a,b,,d", "a,b,c,d,e"] {
            assert!(four(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn heights_are_in_their_order() {
        assert_eq!(band("-0.2, 0.5"), Ok((-0.2, 0.5)));
        for bad in ["0.5,0.1", "1", "a,b", "nan,1", "0,inf", "0.1,0.1", "0,1000"] {
            assert!(band(bad).is_err(), "{bad}");
        }
    }
}
