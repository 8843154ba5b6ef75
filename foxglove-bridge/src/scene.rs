//! A map and its robots as scenes: what each receiver has been told of them, and what comes next.
//! No network, no clock.
//!
//! | module | idea |
//! | --- | --- |
//! | `shapes` | arrows, lines, texts in the plane |
//! | `entities` | what is on a map, an entity each |
//! | `map_progress` | what a receiver has been told of the map, and what has changed since |
//! | `robots` | the robots as they were heard last |
//! | `robot_progress` | what a receiver has been told of the robots |
//! | `floor` | the map as a grid |

mod entities;
mod floor;
mod map_progress;
mod robot_progress;
mod robots;
mod shapes;

pub use entities::{EntityKey, MapScene};
pub(crate) use floor::{FloorDrawing, floor_grid};
pub use map_progress::MapProgress;
pub(crate) use robot_progress::{RobotProgress, poses, transforms};
pub(crate) use robots::{KnownRobots, RobotsNow};
pub(crate) use shapes::{MAP_FRAME, plane_pose};
