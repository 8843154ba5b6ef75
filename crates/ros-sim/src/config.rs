//! A simulated robot's topics, frames and clock.

/// Which of ROS's two types velocity commands have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CommandType {
    /// `geometry_msgs/TwistStamped`, as TurtleBots have it since Jazzy.
    #[default]
    Stamped,
    /// `geometry_msgs/Twist`.
    Plain,
}

/// How the pictures of a simulated robot's cameras are sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "program", derive(clap::ValueEnum))]
pub enum PictureKind {
    /// `sensor_msgs/Image`.
    Raw,
    /// `sensor_msgs/CompressedImage`, without loss.
    Png,
    /// `sensor_msgs/CompressedImage`, as most cameras do.
    Jpeg,
}

/// What a simulated robot calls its topics and frames. Topics without a leading slash are in the
/// node's namespace.
#[derive(Clone, Debug, PartialEq)]
pub struct SimRobotConfig {
    /// Scans. Default scan.
    pub scan: String,
    /// Odometry. Default odom.
    pub odometry: String,
    /// Velocity commands. Default cmd_vel.
    pub cmd_vel: String,
    /// Their type. Default with a stamp.
    pub command_type: CommandType,
    /// The robot's frame. Default base_link.
    pub base_frame: String,
    /// The scanner's frame. Default base_scan.
    pub laser_frame: String,
    /// The frame that the odometry starts from. Default odom.
    pub odom_frame: String,
    /// Without a command for so long the robot stands, seconds of its clock. Default 0.5.
    pub watchdog_s: f64,
    /// What its clock says at the first frame, microseconds since the epoch. Default 10⁹: to ROS,
    /// 0 is no time.
    pub begin_us: u64,
    /// Whether `/clock` says what time it is. Default no.
    pub has_clock: bool,
    /// How the cameras' pictures are sent. Default none: it has no cameras.
    pub pictures: Option<PictureKind>,
    /// Height of the cameras over the base, metres. Default 1.01.
    pub camera_height_m: f64,
}

impl Default for SimRobotConfig {
    fn default() -> Self {
        Self {
            scan: "scan".to_owned(),
            odometry: "odom".to_owned(),
            cmd_vel: "cmd_vel".to_owned(),
            command_type: CommandType::default(),
            base_frame: "base_link".to_owned(),
            laser_frame: "base_scan".to_owned(),
            odom_frame: "odom".to_owned(),
            watchdog_s: 0.5,
            begin_us: 1_000_000_000,
            has_clock: false,
            pictures: None,
            camera_height_m: 1.01,
        }
    }
}
