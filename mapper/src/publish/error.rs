//! Why publishing ends early.

use super::spool::SpoolError;
use super::verify::NumberTaken;
use super::window::ForeignWriter;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{CodecError, MapName};

/// Why publishing ended.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// The session failed for good.
    #[error("the connection to the map server failed: {}", fht_session::in_words(.0))]
    Session(#[from] zenoh::Error),
    /// An increment that the server would refuse: a defect of this program.
    #[error("an increment cannot be sent: {0}")]
    Increment(#[from] CodecError),
    /// Whether the map exists is not known.
    #[error("no map server told within {seconds} s whether there is a map '{map}': {reason}")]
    NoAnswer {
        /// The map asked for.
        map: MapName,
        /// How long was waited.
        seconds: u64,
        /// What came instead of an answer, the last time.
        reason: String,
    },
    /// The server has increments of this author that this run has not made.
    #[error("{0}; give every robot a --robot of its own, and every run a --map of its own")]
    Foreign(#[from] ForeignWriter),
    /// The server has another increment under a number of this run.
    #[error("{0}; start this robot again, and give every robot a --robot of its own")]
    Taken(#[from] NumberTaken),
    /// The robot's disk failed.
    #[error(transparent)]
    Spool(#[from] SpoolError),
    /// The server refuses increments of this run and would do so again.
    #[error("the map server refuses this run's increments: {}{}", .0.message, advice(.0.code))]
    Refused(ErrorReply),
}

fn advice(code: ErrorCode) -> &'static str {
    match code {
        ErrorCode::Conflict => " (another robot of the same name writes this map)",
        ErrorCode::Future => " (is this robot's clock right?)",
        _ => "",
    }
}
