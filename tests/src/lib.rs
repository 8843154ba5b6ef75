//! What only whole systems can show: the handoff demo, end-to-end scenarios, evaluations.
//!
//! | module | idea |
//! | --- | --- |
//! | [`process`] | the programs as child processes that end with their parent |
//! | [`handoff`] | the demo: map, keep, relocalize, drive |
//! | [`python`] | other people's programs, from PyPI |
//! | [`picture`] | a map as a picture, like the paper's figure 1 |
//! | [`survey`] | explored worlds, kept for evaluations |
//! | [`storage`] | what a map's bytes are spent on |
//! | [`known`] | how much of what a robot sees the main nodes' scans know |

pub mod handoff;
pub mod known;
pub mod picture;
pub mod process;
pub mod python;
pub mod storage;
pub mod survey;
