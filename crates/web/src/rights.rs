//! What somebody may do.

use serde::Serialize;

/// What somebody may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Rights {
    /// Nothing at all.
    Nothing,
    /// Look, and ask.
    Look,
    /// Change maps, too.
    Change,
}
