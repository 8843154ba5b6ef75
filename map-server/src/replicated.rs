//! A server that keeps nothing itself: its increments lie in replicated Zenoh storages in the
//! site's routers.
//!
//! | module | idea |
//! | --- | --- |
//! | `storages` | what storages can be asked |
//! | `zenoh_storages` | the storages of Zenoh routers |
//! | `quorum` | the log in memory, in front of storages that hold it |
//! | `gap_fill` | fetches what a server has missed |
//! | `stateless` | these parts, and the thread that looks for gaps |

mod gap_fill;
mod quorum;
mod stateless;
mod storages;
mod zenoh_storages;

pub use gap_fill::{GapFill, restore};
pub use quorum::{QuorumLog, settle_disputed};
pub(crate) use stateless::Stateless;
pub use storages::{Held, IncrementKey, Storages};
