//! People who walk about in a building, stand and gather; and how they meet a robot.
//!
//! | module | idea |
//! | --- | --- |
//! | `config` | how many there are, and how they walk |
//! | `body` | what a scanner, a camera and a bumper meet of somebody |
//! | `walkways` | the ways to the places where people meet, around walls and furniture |
//! | `social_force` | what makes somebody speed up, turn and give way |
//! | `person` | somebody: what he is about, and whom he has touched |
//! | `crowd` | everybody, step by step |
//! | `stored` | everybody as plain data |
//!
//! They move by the social-force model (Helbing and Molnár, "Social force model for pedestrian
//! dynamics", Physical Review E 51, 1995). The robot is to them what another person is: they give
//! way, and the world does not wait for it.

pub(crate) mod body;
mod config;
pub(crate) mod crowd;
mod person;
mod social_force;
pub(crate) mod stored;
mod walkways;

pub use body::{Body, BodyKind};
pub use config::PeopleConfig;
pub use person::Contacts;
