//! Where a page of a long reply begins: each reply that comes in pages has a cursor of its own.

/// A text that no reply gave as where its next page begins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} is not what a reply gave as next")]
pub struct ParseCursorError(String);

impl ParseCursorError {
    /// Of the text, or its beginning.
    pub(super) fn of(text: &str) -> Self {
        Self(text.chars().take(80).collect())
    }
}
