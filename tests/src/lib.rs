//! What only whole systems can show: programs as processes, fleets, breaking links, killed
//! machines, other people's clients. The scenarios are in `tests/`; this crate has what they share,
//! and what the programs in `src/bin/` measure.
//!
//! | module | idea |
//! | --- | --- |
//! | [`simulation`] | a fleet on a bad network, in simulated time |
//! | [`fleet`] | many clients on one server, beside bare queries |
//! | [`thin_link`] | a slow link that breaks |
//! | [`slow_join`] | a client that joins a map over such a link |
//! | [`site`] | several routers and servers, killed again and again under load |
//! | [`soak`] | robots that come and go for an hour, and a server that is killed meanwhile |
//! | [`router`] | a Zenoh router with storages, in zenohd's place |
//! | [`maps`] | maps to try them on: explored, or drawn |
//! | [`museum_demo`] | the demo in the museum |
//! | [`corridors`] | the smallest map with a way in it |
//! | [`upload`] | puts a map on a server |
//! | [`trial`] | why a trial on a server ends without a result |
//! | [`packages`] | other people's packages, from PyPI and npm |
//! | [`foreign_ros`] | other projects' ROS 2 programs |
//!
//! One simulated fleet, determined by its seed:
//!
//! ```
//! use fht_tests::simulation::{SimulationConfig, run};
//!
//! let config = SimulationConfig { increments: 10, trouble_s: 5, ..SimulationConfig::default() };
//! let outcome = run(1, &config).expect("all copies are one in the end");
//! assert!(outcome.increments > 0);
//! ```

pub mod corridors;
pub mod fleet;
pub mod foreign_ros;
pub mod maps;
pub mod museum_demo;
pub mod packages;
pub mod router;
pub mod simulation;
pub mod site;
pub mod slow_join;
pub mod soak;
pub mod thin_link;
pub mod trial;
pub mod upload;
