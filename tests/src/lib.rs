//! What only whole systems can show: the handoff demo, end-to-end scenarios, evaluations.
//!
//! | module | idea |
//! | --- | --- |
//! | [`process`] | the programs as child processes that end with their parent |
//! | [`router`] | a Zenoh router with storages, in zenohd's place |
//! | [`fleet`] | many clients on one server, beside bare queries |
//! | [`thin_link`] | a slow link that breaks |
//! | [`joining`] | a client that joins over such a link |
//! | [`feed`] | putting a map on a server |
//! | [`handoff`] | the demo: map, keep, relocalize, drive |
//! | [`python`] | other people's programs, from PyPI |
//! | [`picture`] | a map as a picture, like the paper's figure 1 |
//! | [`survey`] | explored worlds, kept for evaluations |
//! | [`storage`] | what a map's bytes are spent on |
//! | [`known`] | how much of what a robot sees the main nodes' scans know |
//! | [`grid_map`] | the explorer's occupancy grid, kept and counted |
//! | [`drive`] | a recorded drive of a robot that does not know where it is |
//! | [`systems`] | the systems that are compared: ours, AMCL, MR-TopoMap |
//! | [`simulation`] | a fleet on a bad network, in simulated time |
//! | [`team`] | several explorers in one building, in simulated time |
//! | [`site`] | several routers and servers, killed again and again under load |
//! | [`trial`] | one system on one drive |
//! | [`merging`] | maps made apart, merged, against the truth |
//! | [`ledger`] | results that cost minutes, kept as they come |

pub mod drive;
pub mod feed;
pub mod fleet;
pub mod grid_map;
pub mod handoff;
pub mod joining;
pub mod known;
pub mod ledger;
pub mod merging;
pub mod picture;
pub mod process;
pub mod python;
pub mod router;
pub mod simulation;
pub mod site;
pub mod storage;
pub mod survey;
pub mod systems;
pub mod team;
pub mod thin_link;
pub mod trial;
