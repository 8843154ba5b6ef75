//! The log that a server keeps: every acknowledged increment, or what compaction has left of them.
//!
//! | module | idea |
//! | --- | --- |
//! | `log` | what a log of increments is |
//! | `error` | why one fails |
//! | `redb_log` | the log in a file |
//! | `memory` | the log in memory |
//! | `guard` | a panic over a damaged file is an error |

mod error;
mod guard;
mod log;
mod memory;
mod redb_log;

pub use error::StoreError;
pub use log::{
    CompactedRecord, CompactionFloor, DeletionRecord, IncrementLog, IncrementOrigin, Lacking, LogReader, Piece, Record,
    Stored, Visit,
};
pub use memory::MemoryLog;
pub(crate) use redb_log::{DirectoryLock, LOCK_NAME, end_sum};
pub use redb_log::{FILE_NAME, RedbLog, StoreDisk};
