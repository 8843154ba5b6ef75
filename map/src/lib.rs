//! The FHT-Map as a data structure.
//!
//! | module | idea |
//! | --- | --- |
//! | [`state`] | a map is a join of increments: newest stamp wins, in whatever order they come |
//! | [`replica`] | which increments have come, and what to do with early, repeated and contradictory ones |
//! | [`graph`] | shortest ways over nodes and edges |
//! | [`route`] | the paper's equation 5: from any place to any place |
//! | [`lookup`] | nodes by place and by appearance |

pub mod graph;
pub mod lookup;
mod register;
pub mod replica;
pub mod route;
pub mod state;

pub use graph::Graph;
pub use replica::{Accepted, Replica};
pub use route::{Route, RouteConfig, RouteError};
pub use state::{Counts, MapState, NodeRef};
