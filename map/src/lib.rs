//! The FHT-Map as a data structure: what the increments of `fht-proto` add up to, and how to find things in it. No I/O
//! and no clock, so that server, mapper and client compute the same from the same increments.
//!
//! | module | idea |
//! | --- | --- |
//! | [`state`] | the join of increments: any order and any repetition gives the same map and the same digest |
//! | [`sequence`] | each author's increments in order, the early ones kept aside within bounds |
//! | [`replica`] | both together: a copy of a map that is fed from the network |
//! | [`graph`] | shortest paths over nodes and edges |
//! | [`map_index`] | what finds things in a large map, kept up with it: all of the following |
//! | [`roads`], `adjacency` | the map as a graph of plain arrays that can be changed |
//! | [`shortest`] | shortest ways over it: A*, with what holds for one query alone |
//! | [`guide`] | what makes that fast: [`landmarks`], [`cells`] (`partition`), `parts` |
//! | `bounds` | how far it is at least to the goals of a query |
//! | [`places`] | nodes by where they and their rectangles are |
//! | [`appearance`] | nodes by what they look like |
//! | [`route`] | a path between two places (paper, equation 5) |
//! | [`free_space`] | where a robot's centre may be: rectangles and corridors as a mesh |
//! | `approach` | the way into the mesh over ground that no rectangle covers |
//! | `any_angle` | the shortest way through a mesh |
//! | `view` | what a main node's scanner saw: ends of beams, and ground that they passed over |
//! | `seen_walls` | walls that a way into the mesh must keep away from |
//! | [`taut`] | the shortest path between two places through free space |
//! | [`lookup`] | nodes by place and by appearance |

mod adjacency;
mod any_angle;
pub mod appearance;
mod approach;
mod bounds;
pub mod cells;
pub mod free_space;
pub mod graph;
pub mod guide;
pub mod landmarks;
pub mod lookup;
pub mod map_index;
mod partition;
mod parts;
pub mod places;
mod register;
pub mod replica;
pub mod roads;
pub mod route;
mod seen_walls;
pub mod sequence;
pub mod shortest;
pub mod state;
pub mod taut;
mod view;

pub use approach::ApproachConfig;
pub use free_space::{FreeSpace, SpaceConfig};
pub use map_index::{IndexConfig, MapIndex};
pub use replica::{Accepted, Replica};
pub use route::{Route, RouteConfig, RouteError};
pub use state::{Counts, MapState, NodeRef};
