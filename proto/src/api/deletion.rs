//! That a map will be deleted, or was: what an operator orders, and what everybody is told.

use crate::api::reply::{ErrorCode, ErrorReply};
use crate::model::ids::{MapName, RobotName};
use crate::model::validate::{Invalid, Validate, check, is_unseen};
use serde::{Deserialize, Serialize};

/// That a map will be deleted, or was: in its head.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct MapDeletion {
    /// When, by the server's clock: microseconds since 1970.
    pub at_us: u64,
    /// The same for people, such as `2026-11-28T10:00:00Z`.
    pub at: String,
    /// The operator that ordered it.
    pub by: String,
    /// The operator's reason.
    pub reason: String,
    /// The map that has all of it now; absent if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moved_to: Option<MapName>,
    /// Whether the map is gone; absent while it is not. The last head that is published says so.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub done: bool,
}

impl MapDeletion {
    /// As a sentence without its full stop, such as `map museum will be deleted at
    /// 2026-11-28T10:00:00Z by desk: mistyped`.
    #[must_use]
    pub fn sentence(&self, map: &MapName) -> String {
        let Self { at, by, reason, moved_to, done, .. } = self;
        let verb = if *done { "was" } else { "will be" };
        let moved = moved_to.as_ref().map(|new| format!("; it has moved to {new}")).unwrap_or_default();
        format!("map {map} {verb} deleted at {at} by {by}: {reason}{moved}")
    }

    /// What a writer of the map is told.
    #[must_use]
    pub fn refusal(&self, map: &MapName) -> ErrorReply {
        ErrorReply::new(ErrorCode::Deleted, &self.sentence(map))
    }
}

/// That a map is to be deleted: the payload of an operator's order, as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeletionOrder {
    /// How long the map can still be read, seconds.
    pub grace_s: u64,
    /// Why, for everybody who used the map.
    pub reason: String,
    /// The operator.
    pub by: RobotName,
    /// The map that has all of it now.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moved_to: Option<MapName>,
}

impl DeletionOrder {
    /// Longest grace period, seconds: ten years.
    pub const MAX_GRACE_S: u64 = 10 * 365 * 86_400;
    /// Longest reason, characters.
    pub const MAX_REASON: usize = 300;

    /// Whether a text is a reason: neither empty nor too long, and in one line.
    ///
    /// # Errors
    /// What is wrong.
    pub fn check_reason(text: &str) -> Result<(), Invalid> {
        check(!text.trim().is_empty(), || "a deletion needs a reason".to_owned())?;
        check_text("a reason", text)
    }
}

fn check_text(what: &str, text: &str) -> Result<(), Invalid> {
    let length = text.chars().count();
    check(length <= DeletionOrder::MAX_REASON, || {
        format!("{what} of {length} characters is over {}", DeletionOrder::MAX_REASON)
    })?;
    check(!text.contains(is_unseen), || format!("{what} has control characters"))
}

impl Validate for MapDeletion {
    fn validate(&self) -> Result<(), Invalid> {
        check_text("a time", &self.at)?;
        check_text("an operator", &self.by)?;
        check_text("a reason", &self.reason)
    }
}

impl Validate for DeletionOrder {
    fn validate(&self) -> Result<(), Invalid> {
        check(self.grace_s <= Self::MAX_GRACE_S, || format!("a grace period of {} s is over ten years", self.grace_s))?;
        Self::check_reason(&self.reason)
    }
}
