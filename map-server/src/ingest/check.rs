//! What can be wrong with an arriving increment: everything that can be checked without knowing its
//! map.

use crate::config::Limits;
use crate::ingest::room::RoomLimit;
use crate::store::IncrementOrigin;
use fht_map::{RoleViolation, WriterRole};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::codec::envelope::is_canonical;
use fht_proto::{CodecError, Increment, Invalid, MapName, Op, decode};

/// What arrived under a key, not yet decoded.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// The key expression.
    pub key: String,
    /// The payload, or why it was not even read.
    pub payload: Result<Vec<u8>, Refusal>,
}

impl Arrival {
    /// How much memory it takes, bytes.
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
    pub origin: IncrementOrigin,
}

impl Checked {
    /// Roughly how much memory it takes, bytes.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        size_of::<Self>() + self.bytes.len() + self.increment.memory_bytes()
    }
}

impl PartialEq for Checked {
    // An increment has exactly one form in bytes; `check` makes sure of it.
    fn eq(&self, other: &Self) -> bool {
        self.map == other.map && self.bytes == other.bytes
    }
}

/// Why an increment was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// The key is neither `fht/{map}/inc/{author}/{number}` nor `fht/{map}/kept/{author}/{number}`.
    #[error(
        "the key is not that of an increment: fht/MAP/inc/AUTHOR/NUMBER, its number from 1 on without zeros before it"
    )]
    Key,
    /// Increments cannot be deleted.
    #[error("increments cannot be deleted")]
    Delete,
    /// It is longer than [`Limits::max_increment_bytes`].
    #[error("{bytes} bytes are over the limit")]
    TooLong {
        /// Its length, bytes.
        bytes: usize,
    },
    /// It does not decode, or its contents are invalid.
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
    #[error(
        "the increment's stamp is {ahead_s} s ahead of the server's clock: its writer's clock is wrong, or the server's"
    )]
    Future {
        /// How far, seconds.
        ahead_s: u64,
    },
    /// Another increment of this author and number is stored.
    #[error(
        "another increment with this author and number came before it: the same name has written both maps, or ran twice"
    )]
    Conflict,
    /// A map of other authors has the name that is imported to.
    #[error(
        "map {0} is there, and nobody who wrote it wrote what is imported: they may lie anyhow to each other. Give \
         another name (--map NAME); map-server merge {0} NAME then finds out how they lie"
    )]
    OtherMap(MapName),
    /// A compacted series would come before increments that the map has, or leaves a gap.
    #[error("folded increments go only into a new map: give another name")]
    CompactedBeside,
    /// Other servers stand on the same increments, one by one.
    #[error("folded increments go only to a server that keeps its own log: this one stands on storages")]
    CompactedShared,
    /// It draws a zone that is none.
    #[error("zone {name}: {reason}")]
    Zone {
        /// The zone's name.
        name: String,
        /// What is wrong with its border.
        reason: Invalid,
    },
    /// The map will be deleted, or was.
    #[error("{0}")]
    Deleted(String),
    /// The disk takes nothing.
    #[error(
        "the server takes nothing in at present, for its disk cannot be written ({0}): what is sent again later is taken"
    )]
    ReadOnly(String),
    /// The map cannot be read.
    #[error("{0}")]
    Damaged(String),
    /// One of [`Limits`] is exceeded, or the limit of authors.
    #[error("the limit of {0} is reached: {remedy}", remedy = .0.remedy())]
    Full(RoomLimit),
    /// What is left of one of [`Limits`] is kept for operators.
    #[error("the limit of {0} is reached, but for what is kept for operators: {remedy}", remedy = .0.remedy())]
    Reserved(RoomLimit),
    /// The author's role does not allow it.
    #[error("{0}")]
    NotPermitted(#[from] RoleViolation),
    /// The author has taken away too much of what others made.
    #[error(
        "{name} has taken away {taken} nodes of others within an hour, and {more} more are over its quota of {allowed}: \
         an operator may remove them"
    )]
    TakenAway {
        /// The author's name.
        name: String,
        /// How many it has taken away.
        taken: usize,
        /// How many this increment would take away.
        more: usize,
        /// How many it may take away.
        allowed: usize,
    },
    /// The author has used up its [quota](crate::config::Quotas).
    #[error("{role} {name} has used up its quota of {of}: {most} (an operator raises it with map-server quota set)")]
    Quota {
        /// The author's role.
        role: WriterRole,
        /// The author's name.
        name: String,
        /// What there is a quota of.
        of: RoomLimit,
        /// The quota.
        most: u64,
    },
    /// The author writes faster than its quota allows.
    #[error("{name} writes more than {per_s} increments a second: some were dropped, and may be sent again")]
    TooFast {
        /// The author's name.
        name: String,
        /// The quota, increments a second.
        per_s: f64,
    },
}

impl Refusal {
    /// The reason, as its writer is told.
    #[must_use]
    pub fn reply(&self) -> ErrorReply {
        let code = match self {
            Self::Conflict | Self::CompactedBeside => ErrorCode::Conflict,
            Self::NotCanonical => ErrorCode::NotCanonical,
            Self::Full(_) | Self::Reserved(_) | Self::Quota { .. } => ErrorCode::Full,
            Self::NotPermitted(_) | Self::TakenAway { .. } => ErrorCode::NotPermitted,
            Self::TooFast { .. } => ErrorCode::Busy,
            Self::Deleted(_) => ErrorCode::Deleted,
            Self::ReadOnly(_) => ErrorCode::ReadOnly,
            Self::Damaged(_) => ErrorCode::Damaged,
            Self::Future { .. } => ErrorCode::Future,
            Self::TooLong { .. } => ErrorCode::TooLong,
            // Damaged on the way, or not from a writer at all.
            Self::CompactedShared
            | Self::OtherMap(_)
            | Self::Key
            | Self::Delete
            | Self::Codec(_)
            | Self::OtherKey { .. }
            | Self::Zone { .. } => ErrorCode::BadRequest,
        };
        ErrorReply::new(code, &self.to_string())
    }

    /// Whether it is for what this increment holds, and not for its map, its author, or the room.
    #[must_use]
    pub fn is_of_contents(&self) -> bool {
        use ErrorCode::{BadRequest, Conflict, Future, NotCanonical, TooLong};
        matches!(self.reply().code, BadRequest | Conflict | Future | NotCanonical | TooLong)
    }
}

/// The map that a key names, even if the key is otherwise invalid.
#[must_use]
pub fn map_of(key: &str) -> Option<MapName> {
    key.split('/').nth(1).and_then(|name| name.parse().ok())
}

/// Checks an arrival, but for its stamp.
///
/// # Errors
/// The first thing that is wrong.
pub fn check(arrival: Arrival, limits: &Limits) -> Result<Checked, Refusal> {
    let (map, author, number, origin) = match arrival.key.parse() {
        Ok(Key::Increment { map, author, number }) => (map, author, number, IncrementOrigin::Writer),
        Ok(Key::Kept { map, author, number }) => (map, author, number, IncrementOrigin::Storages { copies: 0 }),
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
    Ok(Checked { map, increment, bytes, origin })
}

/// How far a stamp may be beyond a clock of a map that is itself ahead, microseconds: writers stamp
/// a microsecond later than all that they have seen, and may have a few under way.
const AFTER_CLOCK_US: u64 = 1000;

/// Checks that honest writers can still overwrite a stamp at `now_us` (microseconds since the Unix
/// epoch). What was stamped while the server's own clock was ahead is there: writers go on from
/// `clock_us`, the newest stamp of the map.
///
/// # Errors
/// [`Refusal::Future`].
pub fn check_stamp(hlc_us: u64, clock_us: u64, limits: &Limits, now_us: u64) -> Result<(), Refusal> {
    let ahead_s = hlc_us.saturating_sub(now_us) / 1_000_000;
    let is_ahead = ahead_s > limits.max_clock_ahead_s && hlc_us > clock_us.saturating_add(AFTER_CLOCK_US);
    if is_ahead { Err(Refusal::Future { ahead_s }) } else { Ok(()) }
}

/// Checks what an operator has drawn. Maps from files and storages may have more: they were
/// accepted before.
///
/// # Errors
/// [`Refusal::Zone`].
pub fn check_words(checked: Checked) -> Result<Checked, Refusal> {
    let zones = checked.increment.ops.iter().filter(|_| checked.origin == IncrementOrigin::Writer);
    let bad = zones.filter_map(|op| match op {
        Op::SetZone { name, zone: Some(zone) } => Some((name, zone.check_border().err()?)),
        _ => None,
    });
    let first = bad.map(|(name, reason)| Refusal::Zone { name: name.to_string(), reason }).next();
    first.map_or(Ok(checked), Err)
}
