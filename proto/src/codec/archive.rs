//! A map in one file: a line of JSON that says what it is, then messages with all its increments.
//!
//! ```text
//! {"format":"fht-map 1","map":"museum","version":17,"vector":{…},"digest":"…"}\n
//! series of increments, each in its envelope; folds before increments
//! ```

use crate::codec::envelope::{CodecError, decode, split_first};
use crate::model::compaction::Series;
use crate::model::ids::MapName;
use crate::model::version::{Digest, VersionVector};
use serde::{Deserialize, Serialize};

/// What stands in the first line.
const FORMAT: &str = "fht-map 1";
/// Longest first line, bytes: that of a few thousand authors.
const MAX_HEADER_BYTES: usize = 256 << 10;

/// What a file is of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ArchiveHeader {
    /// The format.
    format: String,
    /// The map that it was.
    pub map: MapName,
    /// Sum of the vector.
    pub version: u64,
    /// The increments in the file.
    pub vector: VersionVector,
    /// Hash of the map that they add up to.
    pub digest: Digest,
}

impl ArchiveHeader {
    /// The header of a file with these increments of a map.
    #[must_use]
    pub fn new(map: MapName, vector: VersionVector, digest: Digest) -> Self {
        Self { format: FORMAT.to_owned(), map, version: vector.version(), vector, digest }
    }
}

/// Why a file cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ArchiveError {
    /// It does not begin as such files do.
    #[error("this is not a map that was exported: {0}")]
    Header(String),
    /// It does not even begin with an object of JSON.
    #[error("this is not a map that was exported")]
    SomethingElse,
    /// It was written by a later program.
    #[error("the file's format is {0}; this program reads {FORMAT}")]
    Format(String),
    /// A message in it is damaged.
    #[error("the file is damaged at byte {at}: {reason}")]
    Message {
        /// Where.
        at: usize,
        /// Why.
        reason: CodecError,
    },
}

/// Whether a file that begins so is a map that was exported, by this program or a later one.
#[must_use]
pub fn is_archive_begin(bytes: &[u8]) -> bool {
    bytes.starts_with(b"{\"format\":\"fht-map ")
}

/// A file, header read. Yields its messages, ends after the first that is damaged.
#[derive(Clone, Debug)]
pub struct Archive<'a> {
    /// What it is of.
    pub header: ArchiveHeader,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Archive<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// [`ArchiveError::Header`], [`ArchiveError::SomethingElse`], [`ArchiveError::Format`].
    pub fn open(bytes: &'a [u8]) -> Result<Self, ArchiveError> {
        if !bytes.starts_with(b"{") {
            return Err(ArchiveError::SomethingElse);
        }
        let line = bytes.iter().take(MAX_HEADER_BYTES).position(|&byte| byte == b'\n');
        let end = line.ok_or_else(|| ArchiveError::Header("it has no first line".to_owned()))?;
        let wrong = |error: serde_json::Error| ArchiveError::Header(error.to_string());
        let header: ArchiveHeader = serde_json::from_slice(&bytes[..end]).map_err(wrong)?;
        if header.format != FORMAT {
            return Err(ArchiveError::Format(header.format.chars().take(40).collect()));
        }
        Ok(Self { header, bytes, at: end + 1 })
    }

    /// How much of the file has been read, bytes.
    #[must_use]
    pub fn position(&self) -> usize {
        self.at
    }

    /// The next message's bytes; `None` at the end.
    fn next_bytes(&mut self) -> Option<Result<&'a [u8], CodecError>> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        Some(split_first(rest).map(|(message, _)| {
            self.at += message.len();
            message
        }))
    }
}

impl Iterator for Archive<'_> {
    type Item = Result<Series, ArchiveError>;

    fn next(&mut self) -> Option<Self::Item> {
        let at = self.at;
        let message = self.next_bytes()?.and_then(decode);
        Some(message.map_err(|reason| {
            self.at = self.bytes.len();
            ArchiveError::Message { at, reason }
        }))
    }
}

/// The first line of a file.
///
/// # Errors
/// Those of the JSON writer.
pub fn header_line(header: &ArchiveHeader) -> Result<Vec<u8>, serde_json::Error> {
    let mut line = serde_json::to_vec(header)?;
    line.push(b'\n');
    Ok(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_something_else_is_no_damaged_map() {
        for bytes in [&b"root:x:0:0::/root:/bin/bash\n"[..], b"\x89MCAP0\r\n", b""] {
            assert_eq!(Archive::open(bytes).err(), Some(ArchiveError::SomethingElse));
        }
        let said = |bytes: &[u8]| Archive::open(bytes).err().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(said(b"GIF89a\n"), "this is not a map that was exported");
        assert_eq!(said(b"{}"), "this is not a map that was exported: it has no first line");
        assert!(said(b"{\"map\": 1}\n").starts_with("this is not a map that was exported: "));
    }
}
