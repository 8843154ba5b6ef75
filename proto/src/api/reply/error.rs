//! Error replies: a code for programs and a sentence for people.

use crate::model::validate::is_unseen;
use serde::{Deserialize, Deserializer, Serialize};

/// What went wrong, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum ErrorCode {
    /// Both places are in the map but nothing joins them.
    NoPath,
    /// A place is not in or near the mapped space.
    OutOfMap,
    /// There is no such map.
    UnknownMap,
    /// There is no such version or release of the map.
    UnknownVersion,
    /// There is no such node.
    UnknownNode,
    /// There is no place of this name.
    UnknownPlace,
    /// The goal lies in a zone that no robot may enter, or the start does and there is no way out.
    KeepOut,
    /// The descriptor is of a model that this map does not use.
    IncompatibleModel,
    /// The request cannot be read.
    BadRequest,
    /// The server failed.
    Internal,
    /// Another increment of this author and number is stored.
    Conflict,
    /// An increment is not in the one form that its content has in bytes.
    NotCanonical,
    /// A limit of the server is reached: of a map, of maps, or of all of them together.
    Full,
    /// An increment is stamped too far ahead of the server's clock.
    Future,
    /// An increment is longer than the server takes.
    TooLong,
    /// The map will be deleted, or was: nothing more is written to it.
    Deleted,
    /// The writer's role does not allow what the increment does.
    NotPermitted,
    /// The server's disk cannot be written: it answers, and takes nothing in. To be sent again
    /// later.
    ReadOnly,
    /// An increment of the map in the server's store cannot be read: the map is offline.
    Damaged,
    /// The robot does not know where it is.
    NotLocalized,
    /// The server has too much to answer, or the robot too much to read, at a time: ask again,
    /// after `retry_after_s` if it is given.
    Busy,
    /// The robot knows of no goal of this id.
    UnknownGoal,
    /// No robot of this name takes goals on this map. It may come.
    UnknownRobot,
    /// The robot did not get through: something is in its way, or at its goal.
    Blocked,
    /// The robot had no time left.
    Timeout,
    /// A code that this program does not know: its sender is newer.
    #[serde(other)]
    Unknown,
}

impl ErrorCode {
    /// Whether what was asked for is wrong, or not there.
    #[must_use]
    pub fn is_input(self) -> bool {
        matches!(
            self,
            Self::BadRequest
                | Self::OutOfMap
                | Self::UnknownMap
                | Self::UnknownVersion
                | Self::UnknownNode
                | Self::UnknownPlace
                | Self::UnknownGoal
                | Self::IncompatibleModel
        )
    }

    /// Whether the same question may be answered in a moment, or by somebody else: it says nothing
    /// of what was asked for.
    #[must_use]
    pub fn is_trouble_of_the_server(self) -> bool {
        matches!(self, Self::Internal | Self::Busy)
    }

    /// Whether a refused increment would be refused again, however often it is sent, unless an
    /// operator changes that.
    #[must_use]
    pub fn is_permanent_refusal(self) -> bool {
        matches!(
            self,
            Self::Conflict
                | Self::NotCanonical
                | Self::Full
                | Self::Future
                | Self::TooLong
                | Self::Deleted
                | Self::NotPermitted
        )
    }
}

/// The payload of an error reply, and of what the server puts under a writer's `refused` key.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[error("{message}")]
pub struct ErrorReply {
    /// For programs.
    pub code: ErrorCode,
    /// One sentence for people, without quotes and backslashes: tools show the JSON of this with
    /// escapes. What others say is made so when it is read.
    #[serde(deserialize_with = "read_plain")]
    pub message: String,
    /// With `BUSY`: when to ask again, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub retry_after_s: Option<u32>,
}

impl ErrorReply {
    /// An error reply. Texts of others may have come into the sentence: what tools would show with
    /// escapes is left out. Apostrophes stay.
    #[must_use]
    pub fn new(code: ErrorCode, message: &str) -> Self {
        Self { code, message: plain(message), retry_after_s: None }
    }

    /// `BUSY`, with when to ask again, seconds.
    #[must_use]
    pub fn busy(message: &str, retry_after_s: u32) -> Self {
        Self { retry_after_s: Some(retry_after_s), ..Self::new(ErrorCode::Busy, message) }
    }
}

fn read_plain<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    String::deserialize(deserializer).map(|message| plain(&message))
}

/// A sentence without quotes, backslashes and control characters. A single quote is an apostrophe
/// within a word, and at a word's end unless it closes what one has opened.
fn plain(message: &str) -> String {
    let (mut plain, mut before, mut is_quoted) = (String::with_capacity(message.len()), ' ', false);
    let mut letters = message.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '\'' => {
                let ends_word = before.is_alphanumeric();
                let is_within = ends_word && letters.peek().is_some_and(|next| next.is_alphanumeric());
                if is_within || (ends_word && !is_quoted) {
                    plain.push(letter);
                } else {
                    is_quoted = !is_quoted;
                }
            }
            '"' | '\\' => {}
            _ if is_unseen(letter) => {}
            _ => plain.push(letter),
        }
        before = letter;
    }
    plain
}
