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
    /// Whether nobody answered when the server was asked last.
    pub is_unanswered: bool,
}

impl Progress {
    /// Why the server does not acknowledge: what it says, or what may be the matter if it says
    /// nothing.
    #[must_use]
    pub fn reason(&self) -> String {
        why_not_acknowledged(self.refusal.as_ref().map(ToString::to_string).as_deref(), self.is_unanswered)
    }
}

/// Why the server does not acknowledge, given what it says last of what it has not taken, and
/// whether nobody answered when it was asked last.
#[must_use]
pub fn why_not_acknowledged(refusal: Option<&str>, is_unanswered: bool) -> String {
    match refusal {
        _ if is_unanswered => "it does not answer (is it still there?)".to_owned(),
        Some(refusal) => format!("it says: {refusal}"),
        None => "may this robot write? (access control drops silently)".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_that_is_gone_is_not_suspected_of_access_control() {
        assert!(why_not_acknowledged(None, false).contains("may this robot write?"));
        assert_eq!(why_not_acknowledged(Some("READ_ONLY"), false), "it says: READ_ONLY");
        for refusal in [None, Some("READ_ONLY")] {
            assert!(why_not_acknowledged(refusal, true).contains("is it still there?"));
        }
    }
}
