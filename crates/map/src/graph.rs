//! The map as a graph, and shortest ways over it.
//!
//! | module | idea |
//! | --- | --- |
//! | [`road_graph`], `adjacency` | nodes and edges as plain arrays that can be changed |
//! | [`astar`] | shortest ways over it, with what holds for one query alone |
//! | [`search_index`] | what makes that fast: landmarks, cells and parts, kept up with the graph |
//! | [`alt`] | landmarks, and how far it is at least to the goals of a query |
//! | [`overlay_cells`], `partition` | cells that a search passes through in one step |
//! | `components` | parts that nothing joins |
//! | [`dijkstra`] | shortest ways on the map itself, for small maps and for comparison |

mod adjacency;
pub mod alt;
pub mod astar;
mod components;
pub mod dijkstra;
pub mod overlay_cells;
mod partition;
pub mod road_graph;
pub mod search_index;
