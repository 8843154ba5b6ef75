//! Worlds, ray-cast LiDAR and cameras, wheels with drift: a source of sensor frames in place of a
//! building and a robot.
//!
//! ```text
//!  built in  ─ building ─┐
//!  map.yaml  ─ nav2 ─────┼─→ World ──────→ Simulator ──→ SensorFrame
//!  .world    ─ gazebo ───┘   scene, plan   sensing       scan, odometry, panorama
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `world` | a [`World`]: triangles with textures and a true plan; built in or from files |
//! | `scene` | what rays meet, and the light it is seen in |
//! | `sensing` | LiDAR, cameras, wheels |
//! | `chassis` | a robot's body on the floor: it drives, slides along walls and bumps |
//! | `people` | people who walk, stand and gather ([`PeopleConfig`]) |
//! | `commons` | the [`Commons`]: a world that several robots share, and its port ([`SharedWorld`]) |
//! | `simulator` | a [`Simulator`]: one robot in a world, which implements the port |
//! | `photographer` | panoramas of a recorded drive, rendered only where they are wanted |
//! | `setup` | a [`SimSetup`]: which world, where, by which seeds; as flags with `cli` |
//! | `starts` | where robots begin, and where they cannot |
//! | `plan` | the true [`FloorPlan`], for sensors and scoring |
//! | [`scoring`] | how good a result is, by the [`Truth`] of where a robot really is |
//!
//! One scene serves the LiDAR, the cameras and the bumper. The world frame of the built-in worlds
//! has its origin where an explorer starts, x ahead (REP-103).
//!
//! ```
//! use fht_perception::frame::Twist;
//! use fht_sim::{SimConfig, Simulator, load};
//! use std::sync::Arc;
//!
//! let world = Arc::new(load("museum", None, 1)?);
//! let config = SimConfig { camera_every: 0, ..SimConfig::default() };
//! let mut robot = Simulator::new(world.clone(), config, world.start(), 1);
//! let first = robot.sense_first();
//! let next = robot.step(Twist { linear_mps: 0.5, angular_radps: 0.0 });
//! assert_eq!((first.time_us, next.time_us), (0, 200_000));
//! assert_eq!(next.scan.ranges_m.len(), 360);
//! assert!((robot.driven_m() - 0.1).abs() < 1e-9);
//! # Ok::<(), fht_sim::WorldError>(())
//! ```

mod chassis;
mod commons;
mod people;
mod photographer;
mod plan;
mod scene;
pub mod scoring;
mod sensing;
mod setup;
mod simulator;
mod starts;
mod world;

pub use commons::{Commons, CommonsError, CommonsState, Entrant, Going, RobotContacts, SharedWorld, Turn};
pub use people::{Body, BodyKind, Contacts, PeopleConfig};
pub use photographer::Photographer;
pub use plan::{FloorPlan, Mask, path_length_m};
pub use scoring::truth::Truth;
pub use setup::SimSetup;
pub use simulator::{SimConfig, Simulator};
pub use starts::{StartError, StartTrouble, check_start, start_near};
pub use world::{Changes, MapError, PhotographError, SdfError, World, WorldError, check_world, load, load_with};
