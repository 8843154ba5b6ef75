//! A robot that uses the map: it finds out where it is and drives where it is told.
//!
//! | module | idea |
//! | --- | --- |
//! | [`mission`] | a task, carried out by whatever robot stands behind the port |
//! | [`serving`] | goals one after another, as the robot is sent |
//! | `goal_service` | … over Zenoh: [`GoalService`] |
//! | [`goals`] | … of which one is under way and one is next |
//! | [`pilot`] | from frames to commands: the paper's Algorithm 2 |
//! | `path_following` | following a path of the map (section III-C-2) |
//! | `blockages` | ways found blocked, for a while |
//! | `program` | the command line, and the program's simulated world (feature `program`) |
//!
//! A robot of your own implements the port; [`mission::run`] does the rest:
//!
//! ```
//! use client_robot::mission::{self, MissionConfig, MissionError, MissionGoal, Services};
//! use fht_perception::robot::Robot;
//!
//! async fn find_place<R>(robot: R, services: &mut Services<'_>) -> Result<(), MissionError>
//! where
//!     R: Robot,
//! {
//!     let config = MissionConfig::default();
//!     mission::run(robot, config, &MissionGoal::None, services, &mut ()).await?;
//!     Ok(())
//! }
//! ```

mod blockages;
mod goal_service;
pub mod goals;
pub mod mission;
mod path_following;
pub mod pilot;
#[cfg(feature = "program")]
pub mod program;
pub mod serving;

pub use goal_service::GoalService;
