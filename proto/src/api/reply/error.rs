//! Error replies: a code for programs and a sentence for people.

use serde::{Deserialize, Serialize};

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
    /// The robot does not know where it is.
    NotLocalized,
    /// The robot has more to read than it takes in at a time.
    Busy,
    /// The robot knows of no goal of this id.
    UnknownGoal,
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
    /// escapes.
    pub message: String,
}

impl ErrorReply {
    /// An error reply. Texts of others may have come into the sentence: what tools would show with
    /// escapes is left out.
    #[must_use]
    pub fn new(code: ErrorCode, message: &str) -> Self {
        let is_plain = |c: &char| !matches!(c, '\'' | '"' | '\\') && !c.is_control();
        Self { code, message: message.chars().filter(is_plain).collect() }
    }
}
