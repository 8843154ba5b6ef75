//! How far publishing has come.

use crate::publish::Backlog;
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
    /// What an earlier run had left, and was delivered before this run began.
    pub earlier: Option<EarlierDelivery>,
}

/// What an earlier run of the robot had left in its spool, and the server has now.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EarlierDelivery {
    /// How many increments.
    pub increments: usize,
    /// Their bytes, each counted once.
    pub bytes: u64,
}

impl EarlierDelivery {
    /// Of all that is waiting; none if nothing is.
    #[must_use]
    pub fn of(waiting: &Backlog) -> Option<Self> {
        let bytes = waiting.encoded.values().map(|bytes| bytes.len() as u64).sum();
        let increments = waiting.encoded.len();
        (increments > 0).then_some(Self { increments, bytes })
    }
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
    fn what_an_earlier_run_has_left_is_counted() {
        assert_eq!(EarlierDelivery::of(&Backlog::after(7)), None);
        let encoded = [(8, vec![0; 100]), (9, vec![0; 50])].into();
        let left = EarlierDelivery::of(&Backlog { acknowledged: 7, encoded });
        assert_eq!(left, Some(EarlierDelivery { increments: 2, bytes: 150 }));
    }

    #[test]
    fn a_server_that_is_gone_is_not_suspected_of_access_control() {
        assert!(why_not_acknowledged(None, false, None).contains("may this robot write?"));
        assert_eq!(why_not_acknowledged(Some("READ_ONLY"), false, None), "it says: READ_ONLY");
        for refusal in [None, Some("READ_ONLY")] {
            assert!(why_not_acknowledged(refusal, true, None).contains("is it still there?"));
        }
    }
}
