//! How far publishing has come.

use fht_proto::api::reply::{ErrorReply, Head};
use serde::{Deserialize, Serialize};

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
    /// The server has less than it had acknowledged, whenever it is asked.
    pub loss: Option<ServerLoss>,
}

/// A server has less of an author's increments than it had acknowledged: an older state was
/// restored, or it is another server.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ServerLoss {
    /// Number up to which it has them.
    pub has: u64,
    /// Number up to which it had acknowledged them.
    pub acknowledged: u64,
}

impl std::fmt::Display for ServerLoss {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { has, acknowledged } = self;
        write!(
            f,
            "it has increments up to {has}, and had acknowledged those up to {acknowledged}: an older state of the map \
             was restored, or this is another server, and what follows on the lost ones is not taken; explore into a \
             new map (--map), or begin under another name (--robot)"
        )
    }
}

impl Progress {
    /// Why the server does not acknowledge: what it says, or what may be the matter if it says
    /// nothing.
    #[must_use]
    pub fn reason(&self) -> String {
        let refusal = self.refusal.as_ref().map(ToString::to_string);
        why_not_acknowledged(refusal.as_deref(), self.is_unanswered, self.loss)
    }
}

/// Why the server does not acknowledge, given what it says last of what it has not taken, and
/// whether nobody answered when it was asked last.
#[must_use]
pub fn why_not_acknowledged(refusal: Option<&str>, is_unanswered: bool, loss: Option<ServerLoss>) -> String {
    if let Some(loss) = loss {
        return loss.to_string();
    }
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
        assert!(why_not_acknowledged(None, false, None).contains("may this robot write?"));
        assert_eq!(why_not_acknowledged(Some("READ_ONLY"), false, None), "it says: READ_ONLY");
        for refusal in [None, Some("READ_ONLY")] {
            assert!(why_not_acknowledged(refusal, true, None).contains("is it still there?"));
        }
    }
}
