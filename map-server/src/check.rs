//! What is wrong with an arriving increment: everything that can be said without knowing its map.

use crate::config::Limits;
use crate::log::Origin;
use fht_proto::envelope::is_canonical;
use fht_proto::keys::Key;
use fht_proto::query::{ErrorCode, ErrorReply};
use fht_proto::{CodecError, Increment, MapName, decode};

/// What arrived under a key, unread.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// The key expression.
    pub key: String,
    /// The payload, or why there is none to look at.
    pub payload: Result<Vec<u8>, Refusal>,
}

impl Arrival {
    /// What it takes up in memory, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.key.len() + self.payload.as_ref().map_or(0, Vec::len) + size_of::<Self>()
    }
}

/// An increment that may be stored.
#[derive(Clone, Debug)]
pub struct Checked {
    /// The map it is for.
    pub map: MapName,
    /// The increment.
    pub increment: Increment,
    /// The increment in its envelope.
    pub bytes: Vec<u8>,
    /// Where it comes from.
    pub origin: Origin,
}

impl Checked {
    /// What it takes up in memory, about, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.bytes.len() + self.increment.memory_bytes()
    }
}

impl PartialEq for Checked {
    // An increment has one form in bytes; `check` makes sure of it.
    fn eq(&self, other: &Self) -> bool {
        self.map == other.map && self.bytes == other.bytes
    }
}

/// Why an increment was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The key is neither `fht/{map}/inc/{author}/{number}` nor `fht/{map}/kept/{author}/{number}`.
    #[error("the key is not that of an increment")]
    Key,
    /// Increments cannot be deleted.
    #[error("increments cannot be deleted")]
    Delete,
    /// Over [`Limits::max_increment_bytes`].
    #[error("{bytes} bytes are over the limit")]
    TooLong {
        /// How long it is.
        bytes: usize,
    },
    /// It does not decode, or makes no sense.
    #[error(transparent)]
    Codec(#[from] CodecError),
    /// The payload belongs under another key.
    #[error("the payload is increment {author}/{number}, which belongs under another key")]
    OtherKey {
        /// The payload's author.
        author: String,
        /// The payload's number.
        number: u64,
    },
    /// The bytes are not those that the increment encodes to.
    #[error("the payload is not in canonical form")]
    NotCanonical,
    /// The stamp is too far in the future.
    #[error("its stamp is {ahead_s} s ahead of the server's clock")]
    Future {
        /// How far.
        ahead_s: u64,
    },
    /// Another increment of this author and number is stored.
    #[error("another increment with this author and number came before it")]
    Conflict,
    /// A fold would come before increments that the map has, or leaves a gap.
    #[error("folded increments go only into a new map: give another name")]
    FoldBeside,
    /// Other servers stand on the same increments, one by one.
    #[error("folded increments go only to a server that keeps its own log: this one stands on storages")]
    FoldShared,
    /// Over one of [`Limits`], or the limit of authors.
    #[error("the limit of {0} is reached")]
    Full(&'static str),
}

impl Refusal {
    /// The reason as its writer is told.
    #[must_use]
    pub fn reply(&self) -> ErrorReply {
        let code = match self {
            Self::Conflict | Self::FoldBeside => ErrorCode::Conflict,
            Self::NotCanonical => ErrorCode::NotCanonical,
            Self::Full(_) => ErrorCode::Full,
            Self::Future { .. } => ErrorCode::Future,
            Self::TooLong { .. } => ErrorCode::TooLong,
            // Damaged on the way, or not from a writer at all.
            Self::FoldShared | Self::Key | Self::Delete | Self::Codec(_) | Self::OtherKey { .. } => {
                ErrorCode::BadRequest
            }
        };
        ErrorReply::new(code, &self.to_string())
    }
}

/// The map that a key names, whatever else is wrong with it.
#[must_use]
pub fn map_of(key: &str) -> Option<MapName> {
    key.split('/').nth(1).and_then(|name| name.parse().ok())
}

/// Checks an arrival at `now_us` (microseconds since the Unix epoch).
///
/// # Errors
/// The first thing that is wrong.
pub fn check(arrival: Arrival, limits: &Limits, now_us: u64) -> Result<Checked, Refusal> {
    let (map, author, number, origin) = match arrival.key.parse() {
        Ok(Key::Increment { map, author, number }) => (map, author, number, Origin::Writer),
        Ok(Key::Kept { map, author, number }) => (map, author, number, Origin::Storages { copies: 0 }),
        _ => return Err(Refusal::Key),
    };
    let bytes = arrival.payload?;
    if bytes.len() > limits.max_increment_bytes {
        return Err(Refusal::TooLong { bytes: bytes.len() });
    }
    let increment: Increment = decode(&bytes)?;
    if (increment.author, increment.number) != (author, number) {
        return Err(Refusal::OtherKey { author: increment.author.to_string(), number: increment.number });
    }
    if !is_canonical(&increment, &bytes)? {
        return Err(Refusal::NotCanonical);
    }
    // What is kept was let in by a server already, and must be let in by all.
    if origin == Origin::Writer {
        check_stamp(increment.hlc_us, limits, now_us)?;
    }
    Ok(Checked { map, increment, bytes, origin })
}

/// Whether a stamp is one that honest writers can go beyond.
///
/// # Errors
/// [`Refusal::Future`].
pub fn check_stamp(hlc_us: u64, limits: &Limits, now_us: u64) -> Result<(), Refusal> {
    let ahead_s = hlc_us.saturating_sub(now_us) / 1_000_000;
    if ahead_s > limits.max_clock_ahead_s { Err(Refusal::Future { ahead_s }) } else { Ok(()) }
}
