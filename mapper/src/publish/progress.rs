//! How far publishing has come.

use fht_proto::api::reply::{ErrorReply, Head};

/// How far publishing has come.
#[derive(Clone, Debug, Default)]
pub struct Progress {
    /// Number of the newest increment handed over.
    pub written: u64,
    /// Number up to which the server has everything durably.
    pub acknowledged: u64,
    /// Bytes put so far, repetitions included.
    pub wire_bytes: u64,
    /// Bytes of the increments, each counted once.
    pub map_bytes: u64,
    /// The newest head.
    pub head: Option<Head>,
    /// Why the server has not taken what it was sent last, if it says so: it may take it later.
    pub refusal: Option<ErrorReply>,
}

impl Progress {
    /// Why the server does not acknowledge: what it says, or what may be the matter if it says
    /// nothing.
    #[must_use]
    pub fn reason(&self) -> String {
        why_not_acknowledged(self.refusal.as_ref().map(ToString::to_string).as_deref())
    }
}

/// Why the server does not acknowledge, given what it says last of what it has not taken.
#[must_use]
pub fn why_not_acknowledged(refusal: Option<&str>) -> String {
    match refusal {
        Some(refusal) => format!("it says: {refusal}"),
        None => "may this robot write? (access control drops silently)".to_owned(),
    }
}
