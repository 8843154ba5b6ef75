//! Bytes. Every message is an envelope around its `postcard` form:
//!
//! ```text
//! "FHT"  version  kind   length        body            CRC-32 of all before it
//! 3 B    1 B      1 B    varint 1-5 B  length bytes    4 B little-endian
//! ```
//!
//! Node ids inside an increment are written relative to its author and to the node named before
//! (`wire_id.rs`), scans and descriptors as streams of bits (`packing`).

use crate::codec::wire_id::{Names, WireId};
use crate::model::compaction::{CompactedSeries, Rest, Series};
use crate::model::ids::AuthorId;
use crate::model::increment::{Increment, Op};
use crate::model::seen::SeenArea;
use crate::model::signature::Descriptor;
use crate::model::validate::{Invalid, Validate};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// First bytes of every message.
pub const MAGIC: [u8; 3] = *b"FHT";
/// The newest format that this crate reads, and writes where a message needs it.
pub const FORMAT_VERSION: u8 = 4;
/// The format of what was there before format 4, which came with two operations: what has none of
/// them is written as ever, and programs from before can read it.
const COMMON_FORMAT_VERSION: u8 = 3;
/// The oldest format that this crate reads. Increments of each format are those of the next one
/// without the operations that came with it.
pub const OLDEST_FORMAT_VERSION: u8 = 2;
/// Longest body that is read, bytes. Increments are some kilobytes; snapshots travel in chunks of
/// this at most.
pub const MAX_BODY_BYTES: usize = 4 << 20;

/// Why bytes were refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    /// Not our message at all.
    #[error("not an FHT message: it does not start with the bytes FHT")]
    Magic,
    /// Written by a newer (or broken) program.
    #[error(
        "format version {found} is not known here (this program reads {OLDEST_FORMAT_VERSION} to {FORMAT_VERSION})"
    )]
    Version {
        /// The version byte.
        found: u8,
    },
    /// A message of another kind than expected.
    #[error("message kind {found} where kind {expected} was expected")]
    Kind {
        /// The kind byte.
        found: u8,
        /// The kind asked for.
        expected: u8,
    },
    /// Too few or too many bytes for the stated length.
    #[error("the length field does not fit the message of {bytes} bytes")]
    Length {
        /// Bytes given.
        bytes: usize,
    },
    /// A body beyond [`MAX_BODY_BYTES`].
    #[error("a body of {bytes} bytes is over the limit of {MAX_BODY_BYTES}")]
    TooLong {
        /// Bytes stated.
        bytes: usize,
    },
    /// Damaged on the way.
    #[error("the checksum does not match")]
    Checksum,
    /// The body is not what its kind says.
    #[error("the body does not decode: {0}")]
    Body(String),
    /// It decodes but makes no sense.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

/// A message that can be put into an envelope.
pub trait Message: Sized + Validate {
    /// The kind byte. Never reused for another type.
    const KIND: u8;
    /// What `postcard` writes.
    type Wire: Serialize + DeserializeOwned;
    /// To the wire form.
    fn to_wire(&self) -> Self::Wire;
    /// From the wire form.
    fn from_wire(wire: Self::Wire) -> Self;
    /// The oldest format that has all that is in the message, of those that are written.
    fn format(&self) -> u8 {
        COMMON_FORMAT_VERSION
    }
}

fn format_of<'a>(ops: impl Iterator<Item = &'a Op>) -> u8 {
    ops.map(Op::format).fold(COMMON_FORMAT_VERSION, u8::max)
}

/// [`Increment`] with node ids relative to its author and to each other.
#[derive(Debug, Serialize, Deserialize)]
pub struct WireIncrement {
    author: AuthorId,
    number: u64,
    hlc_us: u64,
    ops: Vec<Op<WireId>>,
}

impl Message for Increment {
    const KIND: u8 = 1;
    type Wire = WireIncrement;

    fn to_wire(&self) -> WireIncrement {
        let mut names = Names::of(self.author);
        let ops = self.ops.iter().map(|op| op.clone().map_ids(&mut |id| names.shorten(id))).collect();
        WireIncrement { author: self.author, number: self.number, hlc_us: self.hlc_us, ops }
    }

    fn from_wire(wire: WireIncrement) -> Self {
        let mut names = Names::of(wire.author);
        let ops = wire.ops.into_iter().map(|op| op.map_ids(&mut |id| names.expand(id))).collect();
        Self { author: wire.author, number: wire.number, hlc_us: wire.hlc_us, ops }
    }

    fn format(&self) -> u8 {
        format_of(self.ops.iter())
    }
}

impl Message for Descriptor {
    const KIND: u8 = 2;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

/// [`CompactedSeries`] with node ids as in [`WireIncrement`].
#[derive(Debug, Serialize, Deserialize)]
pub struct WireFold {
    author: AuthorId,
    first: u64,
    last: u64,
    rests: Vec<Rest<WireId>>,
}

impl Message for CompactedSeries {
    const KIND: u8 = 7;
    type Wire = WireFold;

    fn to_wire(&self) -> WireFold {
        let mut names = Names::of(self.author);
        let rests = self.rests.iter().map(|rest| rest.clone().map_ids(&mut |id| names.shorten(id))).collect();
        WireFold { author: self.author, first: self.first, last: self.last, rests }
    }

    fn from_wire(wire: WireFold) -> Self {
        let mut names = Names::of(wire.author);
        let rests = wire.rests.into_iter().map(|rest| rest.map_ids(&mut |id| names.expand(id))).collect();
        Self { author: wire.author, first: wire.first, last: wire.last, rests }
    }

    fn format(&self) -> u8 {
        format_of(self.rests.iter().flat_map(|rest| rest.ops.iter().map(|(_, op)| op)))
    }
}

impl Message for Series {
    // 3 was a series without folds (format 2).
    const KIND: u8 = 6;
    type Wire = (Vec<WireFold>, Vec<WireIncrement>);
    fn to_wire(&self) -> Self::Wire {
        (self.folds.iter().map(Message::to_wire).collect(), self.increments.iter().map(Message::to_wire).collect())
    }
    fn from_wire((folds, increments): Self::Wire) -> Self {
        Self {
            folds: folds.into_iter().map(Message::from_wire).collect(),
            increments: increments.into_iter().map(Message::from_wire).collect(),
        }
    }
    fn format(&self) -> u8 {
        let folds = self.folds.iter().map(Message::format);
        folds.chain(self.increments.iter().map(Message::format)).fold(COMMON_FORMAT_VERSION, u8::max)
    }
}

impl Message for SeenArea {
    const KIND: u8 = 8;
    type Wire = Self;
    fn to_wire(&self) -> Self {
        self.clone()
    }
    fn from_wire(wire: Self) -> Self {
        wire
    }
}

/// Puts a message into an envelope.
///
/// # Errors
/// [`CodecError::Invalid`] if the message would be refused on arrival, [`CodecError::TooLong`] if
/// it is too large.
pub fn encode<M: Message>(message: &M) -> Result<Vec<u8>, CodecError> {
    encode_as(message.format(), message)
}

/// Whether `bytes`, which `message` was decoded from, are those that it is encoded to in their
/// format, and their format is one that has all that is in the message, and not a newer one than
/// that needs.
///
/// # Errors
/// As [`encode`].
pub fn is_canonical<M: Message>(message: &M, bytes: &[u8]) -> Result<bool, CodecError> {
    let version = bytes.get(MAGIC.len()).copied().unwrap_or(FORMAT_VERSION);
    let is_needed = version.max(COMMON_FORMAT_VERSION) == message.format();
    Ok(is_needed && encode_as(version, message)? == bytes)
}

fn encode_as<M: Message>(version: u8, message: &M) -> Result<Vec<u8>, CodecError> {
    message.validate()?;
    let body = postcard::to_stdvec(&message.to_wire()).map_err(|error| CodecError::Body(error.to_string()))?;
    seal(version, M::KIND, &body)
}

/// The envelope round a body, whatever is in it: [`encode`] puts messages in.
///
/// # Errors
/// [`CodecError::TooLong`] if the body is too large.
pub fn seal(version: u8, kind: u8, body: &[u8]) -> Result<Vec<u8>, CodecError> {
    if body.len() > MAX_BODY_BYTES {
        return Err(CodecError::TooLong { bytes: body.len() });
    }
    let mut bytes = Vec::with_capacity(body.len() + 14);
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&[version, kind]);
    let length = u32::try_from(body.len()).map_err(|_| CodecError::TooLong { bytes: body.len() })?;
    let mut varint = [0; 5];
    let varint = postcard::to_slice(&length, &mut varint).map_err(|error| CodecError::Body(error.to_string()))?;
    bytes.extend_from_slice(varint);
    bytes.extend_from_slice(body);
    bytes.extend_from_slice(&crc32fast::hash(&bytes).to_le_bytes());
    Ok(bytes)
}

/// Cuts the first message off a row of them; its body is not looked at.
///
/// # Errors
/// When the bytes do not begin with a whole message.
pub fn split_first(bytes: &[u8]) -> Result<(&[u8], &[u8]), CodecError> {
    let length_error = || CodecError::Length { bytes: bytes.len() };
    let rest = bytes.strip_prefix(&MAGIC).ok_or(CodecError::Magic)?;
    let rest = rest.get(2..).ok_or_else(length_error)?;
    let (length, rest) = postcard::take_from_bytes::<u32>(rest).map_err(|_| length_error())?;
    let length = usize::try_from(length).map_err(|_| length_error())?;
    if length > MAX_BODY_BYTES {
        return Err(CodecError::TooLong { bytes: length });
    }
    let end = bytes.len() - rest.len() + length + size_of::<u32>();
    bytes.split_at_checked(end).ok_or_else(length_error)
}

/// What is wrong with a body. Postcard drops what the types themselves say.
fn in_words(error: postcard::Error) -> String {
    match error {
        postcard::Error::SerdeDeCustom => {
            "it has something that this format does not have: an unknown operation, a scan or descriptor that does not \
             unpack, or a name that is none (of a place or zone: a letter, then letters, digits, _ or -; 64 characters \
             at most)"
                .to_owned()
        }
        error => error.to_string(),
    }
}

/// Takes a message out of its envelope and validates it. Never panics, whatever the bytes.
///
/// # Errors
/// Says what is wrong with the bytes.
pub fn decode<M: Message>(bytes: &[u8]) -> Result<M, CodecError> {
    let rest = bytes.strip_prefix(&MAGIC).ok_or(CodecError::Magic)?;
    let length_error = || CodecError::Length { bytes: bytes.len() };
    let [version, kind, rest @ ..] = rest else { return Err(length_error()) };
    if !(OLDEST_FORMAT_VERSION..=FORMAT_VERSION).contains(version) {
        return Err(CodecError::Version { found: *version });
    }
    if *kind != M::KIND {
        return Err(CodecError::Kind { found: *kind, expected: M::KIND });
    }
    let (length, rest) = postcard::take_from_bytes::<u32>(rest).map_err(|_| length_error())?;
    let length = usize::try_from(length).map_err(|_| length_error())?;
    if length > MAX_BODY_BYTES {
        return Err(CodecError::TooLong { bytes: length });
    }
    let (body, checksum) = rest.split_at_checked(length).ok_or_else(length_error)?;
    let checksum: [u8; 4] = checksum.try_into().map_err(|_| length_error())?;
    if crc32fast::hash(&bytes[..bytes.len() - 4]) != u32::from_le_bytes(checksum) {
        return Err(CodecError::Checksum);
    }
    let (wire, left) = postcard::take_from_bytes::<M::Wire>(body).map_err(|error| CodecError::Body(in_words(error)))?;
    if !left.is_empty() {
        return Err(CodecError::Body(format!("{} bytes are left over", left.len())));
    }
    let message = M::from_wire(wire);
    message.validate()?;
    Ok(message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::geometry::FixedPose;

    #[test]
    fn what_a_body_may_not_have_is_told() -> Result<(), Box<dyn std::error::Error>> {
        let ops = vec![Op::SetPlace { name: "xdock".parse()?, pose: Some(FixedPose::default()) }];
        let increment = Increment { author: AuthorId(1), number: 1, hlc_us: 1, ops };
        let body = postcard::to_stdvec(&increment.to_wire())?;
        assert!(decode::<Increment>(&seal(FORMAT_VERSION, Increment::KIND, &body)?).is_ok());
        let at = body.windows(5).position(|part| part == b"xdock").unwrap_or_default();
        let with = |first: u8| [&body[..at], &[first], &body[at + 1..]].concat();
        for body in [with(b'2'), with(b' '), vec![1, 1, 1, 1, 77, 0, 0]] {
            let refused = decode::<Increment>(&seal(FORMAT_VERSION, Increment::KIND, &body)?);
            let said = refused.map_or_else(|error| error.to_string(), |_| String::new());
            assert!(
                said.contains("an unknown operation, a scan or descriptor that does not unpack, or a name"),
                "{said}"
            );
        }
        Ok(())
    }
}
