//! How far publishing has come.

use fht_proto::api::reply::Head;

/// How far publishing has come.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Number of the newest increment handed over.
    pub written: u64,
    /// Number up to which the server has everything durably.
    pub acknowledged: u64,
    /// Bytes put so far, repetitions included.
    pub wire_bytes: u64,
    /// Bytes of the increments, each counted once.
    pub map_bytes: u64,
    /// The newest head.
    pub head: Option<Head>,
}
