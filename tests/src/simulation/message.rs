//! What is sent between the places of the simulated network.

use crate::simulation::outcome::Violation;
use fht_proto::api::reply::{Head, Series};
use fht_proto::{MapName, VersionVector, decode};
use std::sync::Arc;

/// The nearest running server.
pub(super) const SERVER: usize = usize::MAX - 1;
/// Everybody else.
pub(super) const EVERYBODY: usize = usize::MAX;

/// What is sent.
#[derive(Clone, Debug)]
pub(super) enum Message {
    /// An increment in its envelope, from its author to everybody.
    Put { key: String, bytes: Arc<Vec<u8>> },
    /// A head, from the server to everybody.
    Head(Arc<Head>),
    /// To a writer: the server has another increment of its number.
    Refused,
    /// A question for the head.
    AskHead { id: u64 },
    /// The answer; the server may have no such map.
    HeadAnswer { id: u64, head: Option<Arc<Head>> },
    /// A question for increments.
    AskSince { id: u64, have: VersionVector },
    /// A question for a release.
    AskAt { id: u64, vector: VersionVector, have: VersionVector },
    /// A piece of the answer.
    Piece { id: u64, series: Arc<Series> },
    /// The end of the answer.
    End { id: u64 },
}

pub(super) fn map() -> MapName {
    // A constant that is a valid name.
    "sim".parse().unwrap_or_else(|error| panic!("{error}"))
}

/// A piece of an answer, decoded.
pub(super) fn unpack(bytes: &[u8]) -> Result<Series, Violation> {
    decode(bytes).map_err(|error| Violation::Failed(error.to_string()))
}
