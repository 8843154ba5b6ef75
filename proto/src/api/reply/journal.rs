//! The reply to `journal`: what operators have changed, and who.

use crate::api::reply::cursor::ParseCursorError;
use crate::model::ids::{AuthorId, MapName};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Where a change stands in a journal: changes are ordered by their clocks, then by author and
/// number. As text these three, joined by dots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JournalCursor {
    /// The clock of the increment, microseconds.
    pub hlc_us: u64,
    /// Who wrote it.
    pub author: AuthorId,
    /// Its place in the author's sequence, from 1.
    pub number: u64,
}

impl fmt::Display for JournalCursor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.hlc_us, self.author, self.number)
    }
}

impl FromStr for JournalCursor {
    type Err = ParseCursorError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || ParseCursorError::of(text);
        let parts: Vec<&str> = text.split('.').collect();
        let [hlc_us, author, number] = parts[..] else { return Err(error()) };
        let count = |text: &str| text.parse::<u64>().map_err(|_| error());
        Ok(Self { hlc_us: count(hlc_us)?, author: author.parse().map_err(|_| error())?, number: count(number)? })
    }
}

/// What an operator has changed with one increment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JournalEntry {
    /// When, microseconds since the Unix epoch by its author's clock.
    pub at_us: u64,
    /// Who.
    pub author: AuthorId,
    /// The author's name, if the server knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The increment's place in the author's sequence, from 1.
    pub number: u64,
    /// Whether it is folded: then only what the newest state or a release needs is told.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub folded: bool,
    /// What it did, a sentence each; of very many things the first.
    pub words: Vec<String>,
}

/// The reply to `journal`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JournalReply {
    /// The map.
    pub map: MapName,
    /// Its version.
    pub version: u64,
    /// Newest first.
    pub entries: Vec<JournalEntry>,
    /// What to ask as `after` for those that follow; absent: these are the oldest that are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_is_what_its_text_says() {
        let cursor = JournalCursor { hlc_us: 1_700_000_000_000_000, author: AuthorId(0xa), number: 7 };
        assert_eq!(cursor.to_string(), "1700000000000000.0000000a.7");
        assert_eq!(cursor.to_string().parse(), Ok(cursor));
        for wrong in ["", "1.2", "1.0000000a.7.8", "-1.0000000a.7", "1.a.7", "1.0000000a.", "99999999999999999999.0.1"]
        {
            assert!(wrong.parse::<JournalCursor>().is_err(), "{wrong}");
        }
    }
}
