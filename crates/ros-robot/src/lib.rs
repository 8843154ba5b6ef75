//! A robot that speaks ROS 2 over Zenoh, behind the port for robots
//! ([`fht_perception::robot::Robot`]).
//!
//! ```text
//!  /scan  /odom  /tf  pictures    ──→ intake ──→ SensorFrame ──→ a program that maps or drives
//!                                                                    │
//!  /cmd_vel (Twist or TwistStamped) ←────────────── drive ←──────────┤
//!  /map  /tf  /path  /amcl_pose  /diagnostics ←── outputs ←──────────┘
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `config` | which topics and frames the robot has ([`RosRobotConfig`]) |
//! | `clock` | what clock stamps are of: lag, jumps, other clocks, `/clock` |
//! | `stamps` | by what time the sensors' stamps are judged, and what is odd about them |
//! | `camera_topics` | which topics its four cameras have |
//! | `pictures`, `picture_topics` | from pictures to panoramas, and where they come from |
//! | `intake` | from messages to frames; what keeps them from coming, as a sentence |
//! | `commands` | velocity commands, with a stamp or without |
//! | `robot` | the topics behind the port ([`RosRobot`]) |
//! | `nav2` | Nav2 drives where it is told to ([`Nav2Driver`], [`DrivenByNav2`]) |
//! | `outputs` | what the graph gets back: `map → odom`, the map, the pose ([`RosOutputs`]) |
//! | `check` | what a graph has of what is needed ([`check`]) |
//! | `flags` | graph and topics on the command line (feature `cli`) |
//!
//! A sensor that falls silent is named in the log, and whoever supervises the robot
//! ([`fht_perception::robot::Supervised`]) stops it. What is wrong is told before anything drives:
//!
//! ```
//! use fht_ros_robot::{RosRobotConfig, Readiness, check};
//!
//! let findings = check(&[], &RosRobotConfig::default(), "r1")?;
//! assert_eq!(findings[0].topic, "/r1/scan");
//! assert_eq!(findings[0].readiness, Readiness::Missing);
//! println!("{}: {}", findings[0].topic, findings[0].sentence);
//! # Ok::<(), fht_ros::NameError>(())
//! ```

mod camera_topics;
mod check;
mod clock;
mod commands;
mod config;
#[cfg(feature = "cli")]
mod flags;
mod intake;
mod nav2;
mod outputs;
mod picture_topics;
mod pictures;
mod robot;
mod stamps;

pub use check::{Finding, Readiness, check};
pub use config::RosRobotConfig;
#[cfg(feature = "cli")]
pub use flags::{FourTopics, GraphArgs, NodeArgs, OnlyWithRos};
pub use intake::IntakeReport;
pub use nav2::{DrivenByNav2, Nav2Driver, Nav2State};
pub use outputs::{OutputRole, PlaceNow, RosOutputs};
pub use robot::{OdomFrame, RosRobot, live_silence};
