//! ROS 2's serialization: four bytes that say how, then plain CDR.

use byteorder::{BigEndian, LittleEndian};
use serde::{Deserialize, Serialize};

/// Bytes before the message: a kind of encoding (big-endian number) and two bytes of options.
const HEADER: usize = 4;

/// A message cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CdrError {
    /// Too short for its own header.
    #[error("{0} bytes are too few for a message")]
    Short(usize),
    /// Parameter lists, XCDR 2, or no CDR at all.
    #[error("encoding {0:#06x} is not plain CDR")]
    Encoding(u16),
    /// The bytes do not hold such a message.
    #[error(transparent)]
    Content(#[from] cdr_encoding::Error),
}

/// Reads a message of either byte order; bytes after it are padding.
///
/// # Errors
/// [`CdrError`] when the bytes are not such a message.
pub fn decode<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Result<T, CdrError> {
    let Some((&[high, low, _, _], body)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(CdrError::Short(bytes.len()));
    };
    match u16::from_be_bytes([high, low]) {
        0 => Ok(cdr_encoding::from_bytes::<T, BigEndian>(body)?.0),
        1 => Ok(cdr_encoding::from_bytes::<T, LittleEndian>(body)?.0),
        other => Err(CdrError::Encoding(other)),
    }
}

/// Writes a message in little-endian CDR.
///
/// # Errors
/// [`CdrError`] when `message` has parts that CDR cannot hold (sequences of unknown length).
pub fn encode<T: Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let mut bytes = vec![0, 1, 0, 0];
    // Alignment counts from the end of the header, and the serializer counts what it writes itself.
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message)?;
    Ok(bytes)
}
