//! Worlds, ray-cast LiDAR and cameras, wheels with drift: a source of sensor frames in place of a building and a robot.
//!
//! | module | idea |
//! | --- | --- |
//! | [`world`] | a building: triangles with textures, and its true plan |
//! | [`plan`] | the true floor plan, for scoring only |
//! | [`nav2`] | maps in the format of the ROS 2 map server |
//! | [`gazebo`] | worlds of the Gazebo simulators |
//! | [`photographs`] | the user's pictures for the walls |
//! | [`changes`] | a world some time later: a share of its movable things gone, shifted or added |
//! | [`simulator`] | a robot that drives and senses in a world |
//! | [`photographer`] | panoramas of a recorded drive, taken only where they are wanted |
//!
//! One scene serves the LiDAR, the cameras and the bumper. The world frame of the built-in worlds has its origin where
//! an explorer starts, x ahead (REP-103).

mod camera;
pub mod changes;
mod draw;
mod dress;
mod extrude;
pub mod gazebo;
mod layout;
mod lidar;
mod light;
mod museum;
pub mod nav2;
mod office;
pub mod photographer;
pub mod photographs;
pub mod plan;
mod rearrange;
mod scene;
pub mod simulator;
mod style;
mod texture;
mod wheels;
pub mod world;

pub use changes::Changes;
pub use photographer::Photographer;
pub use plan::FloorPlan;
pub use simulator::{SimConfig, Simulator};
pub use world::{World, WorldError, load, load_with};
