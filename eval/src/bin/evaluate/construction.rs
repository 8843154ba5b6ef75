//! How good maps are as they are made: by one robot, by a team, and joined out of two.
//!
//! | module | idea |
//! | --- | --- |
//! | `slam` | the SLAM alone, on a log |
//! | `explore` | whole explorations of simulated buildings |
//! | `team` | several explorers in one building against one |
//! | `merge` | maps made apart |

pub mod explore;
pub mod merge;
pub mod slam;
pub mod team;
