//! The explorer: turns what it senses into an FHT-Map and publishes it as increments.
//!
//! | module | idea |
//! | --- | --- |
//! | [`run`] | a robot that makes a map, whatever stands behind the port |
//! | `mapping` | from frames to commands and increments, frame by frame: [`Mapper`] |
//! | [`slam`] | where the robot is, and a map that stays true: submaps, loop closure |
//! | [`construct`] | main nodes, support nodes, edges, rectangles (paper, section III-B) |
//! | [`explore`] | where to drive next (paper, equation 1) |
//! | `team` | joining a map that others have begun, and dividing the work with them |
//! | `camera` | descriptors, computed beside the loop |
//! | [`publish`] | increments to the server, kept until they are acknowledged |
//! | `program` | the command line, simulated buildings, recorded runs (feature `program`) |
//!
//! A robot of your own implements the port; [`run::explore`] does the rest:
//!
//! ```
//! use fht_perception::robot::Robot;
//! use mapper::run::{MappingOutcome, MappingTask, RunError, explore};
//!
//! type Outcome<R> = Result<MappingOutcome<R, ()>, RunError>;
//!
//! async fn map_the_building<R>(robot: R, task: MappingTask) -> Outcome<R>
//! where
//!     R: Robot + Send + 'static,
//! {
//!     explore(task, robot, ()).await
//! }
//! ```

mod camera;
pub mod construct;
pub mod explore;
mod haste;
mod mapping;
#[cfg(feature = "program")]
pub mod program;
pub mod publish;
pub mod run;
pub mod slam;
mod team;

pub use camera::CameraError;
pub use haste::Haste;
pub use mapping::{Located, Mapper, MapperConfig, MapperStep};
pub use team::JoinConfig;
