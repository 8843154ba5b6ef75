//! The map as a join of increments.
//!
//! | module | idea |
//! | --- | --- |
//! | `state` | the join: any order and any repetition gives the same map and the same digest |
//! | `leaf`, `register` | what the state is made of: shared leaves of last-writer-wins registers |
//! | `annotations` | what a map says beside nodes and edges: places, zones, releases, models |
//! | [`reorder_buffer`] | each author's increments in order, the early ones kept within bounds |
//! | `replica` | state and buffer together: a copy that is fed from the network |
//! | `history` | whether two maps are states of one |
//! | [`diff`] | what has changed between two states |
//! | [`compaction`] | which operations decide nothing any more |
//! | [`inverse`] | what takes an author's newest increments back |

pub(crate) mod annotations;
pub mod compaction;
pub mod diff;
mod history;
pub mod inverse;
mod leaf;
mod register;
pub mod reorder_buffer;
pub(crate) mod replica;
pub(crate) mod state;
