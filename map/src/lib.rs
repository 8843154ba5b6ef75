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
//! | [`guide`] | what makes that fast: [`landmarks`], [`pieces`] (`partition`), `parts` |
//! | `bounds` | how far it is at least to the goals of a query |
//! | [`places`] | nodes by where they and their rectangles are |
//! | [`appearance`] | nodes by what they look like |
//! | [`route`] | a path between two places (paper, equation 5) |
//! | [`free_space`] | where a robot's centre may be: rectangles and corridors as a mesh |
//! | `contours` | rectangles, corridors and obstacles as outlines |
//! | `inner` | what lies well inside of all rectangles |
//! | `zones` | what operators keep out, and barriers across edges that they closed |
//! | `limits` | how much work a mesh may be |
//! | `mesh` | triangles: neighbours, places, and which of them a way can lead through |
//! | `cells` | things by place |
//! | `plane` | places and lines |
//! | `approach` | the way into the mesh over ground that no rectangle covers |
//! | `any_angle` | the shortest way through a mesh |
//! | `interval` | what is seen of a triangle's sides |
//! | `view` | what a main node's scanner saw: ends of beams, and ground that they passed over |
//! | `seen_walls` | walls that a way into the mesh must keep away from |
//! | [`taut`] | the shortest path between two places through free space |
//! | [`annotations`] | what a map says beside nodes and edges: places, zones, releases |
//! | [`blocked`] | what robots found blocked, while it lasts |
//! | [`rules`] | what operators and robots have closed, and paths that obey |
//! | [`diff`] | what has changed between two states |
//! | [`fold`] | which operations nobody needs any more |
//! | [`lookup`] | nodes by place and by appearance |

mod adjacency;
pub mod annotations;
mod any_angle;
pub mod appearance;
mod approach;
pub mod blocked;
mod bounds;
mod cells;
mod contours;
pub mod diff;
pub mod fold;
pub mod free_space;
pub mod graph;
pub mod guide;
mod inner;
mod interval;
pub mod landmarks;
mod leaf;
mod limits;
pub mod lookup;
pub mod map_index;
mod mesh;
mod partition;
mod parts;
pub mod pieces;
pub mod places;
mod plane;
mod register;
pub mod replica;
pub mod roads;
pub mod route;
pub mod rules;
mod seen_walls;
pub mod sequence;
pub mod shortest;
pub mod state;
pub mod taut;
mod view;
mod zones;

pub use annotations::{Annotations, ReleaseRef};
pub use approach::ApproachConfig;
pub use free_space::{FreeSpace, SpaceConfig};
pub use limits::{OverBudget, SpaceLimits};
pub use map_index::{IndexConfig, MapIndex};
pub use replica::{Accepted, Replica};
pub use route::{Route, RouteConfig, RouteError};
pub use rules::{PlanError, Rules};
pub use state::{Counts, FULL_TRUST, MapState, NodeRef};
