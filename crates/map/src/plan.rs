//! Paths between two places, and what they obey.
//!
//! | module | idea |
//! | --- | --- |
//! | [`node_route`] | over nodes and edges (the paper's equation 11) |
//! | [`shortest_path`] | through all free space that the map knows |
//! | [`rules`] | what operators and robots have closed, and paths that keep out of it |
//! | `kept_rules` | whether a path of somebody else keeps out of it, too |
//! | [`blocked`] | what robots found blocked, while it lasts |
//! | `report_limits` | how much of that a robot may close |
//! | [`words`] | whether what operators name and draw makes sense on the map |

pub mod blocked;
mod kept_rules;
pub mod node_route;
mod report_limits;
pub mod rules;
pub mod shortest_path;
pub mod words;
