//! A simulated robot as a node on a ROS 2 graph: what a TurtleBot with `rmw_zenoh` is to those who
//! map and drive with it.
//!
//! ```text
//!  fht-sim ──→ /scan  /odom  /tf (odom → base_link)  /tf_static  /clock ──→ whoever listens
//!     ↑        /camera_front/image /camera_front/camera_info … if it has cameras
//!     ↑        /ground_truth: where it truly is, in the world
//!     └─────── /cmd_vel (TwistStamped or Twist) ←──────────────────────── whoever drives
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `config` | its topics, frames and clock ([`SimRobotConfig`]) |
//! | `cameras` | its four cameras, if it has them |
//! | `robot` | the topics ([`SimRobot`]), a simulated robot's life ([`live`]), a recorded one's ([`play`]) |
//! | `program` | `sim robot`, `sim play` and `sim router` on the command line (feature `program`) |
//!
//! ```
//! use fht_ros_sim::SimRobotConfig;
//!
//! let config = SimRobotConfig::default();
//! assert_eq!((config.scan.as_str(), config.base_frame.as_str()), ("scan", "base_link"));
//! ```

mod cameras;
mod config;
#[cfg(feature = "program")]
pub mod program;
mod robot;

pub use config::{CommandType, PictureKind, SimRobotConfig};
pub use robot::{LiveError, SimRobot, SimRobotReport, live, play};
