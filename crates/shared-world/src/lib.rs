//! One simulated world for robots whose programs run as processes of their own on one machine: they
//! see each other, and meet the same people. `mapper explore --shared-world NAME` and `client-robot
//! … --shared-world NAME` use it, and so does the demo.
//!
//! ```text
//!  mapper        Simulator ── Participant─┐                 world        the state, behind a lock
//!  mapper        Simulator ── Participant─┼── folder NAME ─ robot-a      locked while a lives
//!  client-robot  Simulator ── Participant─┘                 robot-b      locked while b lives
//! ```
//!
//! There is no server that could die. The world is a file that whoever needs it reads, changes and
//! writes back under the file's lock; the computation is [`fht_sim::Commons`], which knows no
//! files. A robot writes down what it does next. The last one to do so lets time go on by a period,
//! for everybody; the others look again every millisecond. So robots go on together, at the pace of
//! the slowest.
//!
//! Each process holds a lock of its own, which the system takes back however the process ends: the
//! robot of a program that died is gone at the next look. One that lives and says nothing for
//! [`PATIENCE`] is not waited for any longer; its robot stands until it speaks.
//!
//! | module | idea |
//! | --- | --- |
//! | `folder` | the files of a world, and their locks |
//! | `participant` | a robot's place in it ([`Participant`]), and whoever keeps it ([`Keeper`]) |
//!
//! ```
//! use fht_perception::robot::Sensors;
//! use fht_shared_world::seat;
//! use fht_sim::{SimConfig, SimSetup, Simulator};
//! use std::sync::Arc;
//!
//! let name = format!("doc-{}", std::process::id()).parse()?;
//! let setup = SimSetup { shared_world: Some(name), ..SimSetup::of("museum") };
//! let world = Arc::new(setup.load()?);
//! let config = SimConfig { camera_every: 0, ..SimConfig::default() };
//! let place = |robot: &str, ahead_m| {
//!     let start = world.start() * fht_perception::pose::pose(ahead_m, 0.0, 0.0);
//!     seat(Simulator::new(Arc::clone(&world), config.clone(), start, 1), &setup, robot)
//! };
//! let ((mut one, _), (mut other, _)) = (place("one", 0.0)?, place("other", 0.8)?);
//! let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
//! runtime.block_on(async {
//!     one.sense().await?;
//!     other.sense().await?;
//!     let (frame, _) = tokio::try_join!(one.sense(), other.sense())?;
//!     assert!(frame.scan.ranges_m[0] < 0.8);
//!     Ok::<(), fht_perception::robot::RobotError>(())
//! })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod folder;
mod participant;

pub use folder::{WorldFileError, folder_of};
pub use participant::{JoinError, Keeper, PATIENCE, Participant, WorldExit, seat};
