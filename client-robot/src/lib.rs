//! A robot that uses the map: it finds out where it is and drives where it is told.
//!
//! | module | idea |
//! | --- | --- |
//! | [`mission`] | a task, carried out by whatever robot stands behind the port ([`Robot`](fht_perception::robot::Robot)) |
//! | [`pilot`] | from frames to commands: the paper's Algorithm 2 |
//! | `path_following` | following a path of the map (section III-C-2) |
//! | `blockages` | ways found blocked, for a while |
//! | `program` | the command line, and a simulated world for the robot of the program (feature `program`) |
//!
//! A robot of your own implements the port; [`mission::run`] does the rest:
//!
//! ```
//! use client_robot::mission::{MissionConfig, MissionError, MissionGoal, MissionOutcome, Services, run};
//! use fht_perception::robot::Robot;
//!
//! async fn find_place<R: Robot>(robot: R, services: &mut Services<'_>) -> Result<MissionOutcome, MissionError> {
//!     run(robot, MissionConfig::default(), &MissionGoal::None, services, &mut ()).await
//! }
//! ```

mod blockages;
pub mod mission;
mod path_following;
pub mod pilot;
#[cfg(feature = "program")]
pub mod program;
