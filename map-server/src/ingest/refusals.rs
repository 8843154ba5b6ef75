//! What writers are told about their refused increments: the reason, at most once a period for each
//! author and kind of reason.

use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, MapName};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A refusal on its way to its writer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RefusalNotice {
    /// The map written to.
    pub map: MapName,
    /// The writer.
    pub author: AuthorId,
    /// The reason.
    pub reply: ErrorReply,
}

/// Decides which refusals are sent.
#[derive(Debug)]
pub struct RefusalThrottle {
    period: Duration,
    sent: BTreeMap<(MapName, AuthorId, ErrorCode), Instant>,
}

impl RefusalThrottle {
    /// How many writers are remembered. Anybody can invent keys: when it is full, other writers are
    /// told nothing until some are forgotten.
    const MAX_REMEMBERED: usize = 1024;

    /// Lets one refusal of each author and code through per `period`.
    #[must_use]
    pub fn new(period: Duration) -> Self {
        Self { period, sent: BTreeMap::new() }
    }

    /// Whether the writer is told about this refusal at `now`.
    pub fn pass(&mut self, notice: &RefusalNotice, now: Instant) -> bool {
        let key = (notice.map.clone(), notice.author, notice.reply.code);
        let is_recent = |sent: &Instant| now.duration_since(*sent) < self.period;
        if self.sent.get(&key).is_some_and(is_recent) {
            return false;
        }
        if self.sent.len() >= Self::MAX_REMEMBERED {
            self.sent.retain(|_, sent| now.duration_since(*sent) < self.period);
        }
        if self.sent.len() >= Self::MAX_REMEMBERED {
            return false;
        }
        self.sent.insert(key, now);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notice(author: u32, code: ErrorCode) -> RefusalNotice {
        let reply = ErrorReply::new(code, "");
        RefusalNotice { map: "m".parse().unwrap(), author: AuthorId(author), reply }
    }

    #[test]
    fn each_author_is_told_each_reason_once_a_period() {
        let (mut refusals, start) = (RefusalThrottle::new(Duration::from_secs(1)), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        assert!(refusals.pass(&notice(1, ErrorCode::BadRequest), at(0)));
        assert!(!refusals.pass(&notice(1, ErrorCode::BadRequest), at(999)));
        assert!(refusals.pass(&notice(1, ErrorCode::Conflict), at(999)), "rubbish does not hide a reason");
        assert!(refusals.pass(&notice(2, ErrorCode::BadRequest), at(999)));
        assert!(refusals.pass(&notice(1, ErrorCode::BadRequest), at(1000)));
    }

    #[test]
    fn invented_authors_are_forgotten() {
        let (mut refusals, start) = (RefusalThrottle::new(Duration::from_secs(1)), Instant::now());
        let told = (0..5000).filter(|&author| refusals.pass(&notice(author, ErrorCode::Full), start)).count();
        assert_eq!(told, RefusalThrottle::MAX_REMEMBERED);
        assert!(refusals.pass(&notice(9999, ErrorCode::Full), start + Duration::from_secs(1)));
    }
}
