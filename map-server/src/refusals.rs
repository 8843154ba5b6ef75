//! What writers are told of their refused increments: the reason, at most once a period for each author and kind of reason.

use fht_proto::query::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, MapName};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// A refusal on its way to its writer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The map written to.
    pub map: MapName,
    /// The writer.
    pub author: AuthorId,
    /// The reason.
    pub reply: ErrorReply,
}

/// Decides which refusals are told.
#[derive(Debug)]
pub struct Refusals {
    period: Duration,
    told: BTreeMap<(MapName, AuthorId, ErrorCode), Instant>,
}

impl Refusals {
    /// Writers that are remembered at one time. Keys are free to invent: the rest is told nothing until others are forgotten.
    const MAX_REMEMBERED: usize = 1024;

    /// Lets through one refusal of each author and code each `period`.
    #[must_use]
    pub fn new(period: Duration) -> Self {
        Self { period, told: BTreeMap::new() }
    }

    /// Whether the writer is told of this refusal at `now`.
    pub fn pass(&mut self, notice: &Notice, now: Instant) -> bool {
        let key = (notice.map.clone(), notice.author, notice.reply.code);
        let is_recent = |told: &Instant| now.duration_since(*told) < self.period;
        if self.told.get(&key).is_some_and(is_recent) {
            return false;
        }
        if self.told.len() >= Self::MAX_REMEMBERED {
            self.told.retain(|_, told| now.duration_since(*told) < self.period);
        }
        if self.told.len() >= Self::MAX_REMEMBERED {
            return false;
        }
        self.told.insert(key, now);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn notice(author: u32, code: ErrorCode) -> Notice {
        let reply = ErrorReply { code, message: String::new() };
        Notice { map: "m".parse().unwrap(), author: AuthorId(author), reply }
    }

    #[test]
    fn each_author_is_told_each_reason_once_a_period() {
        let (mut refusals, start) = (Refusals::new(Duration::from_secs(1)), Instant::now());
        let at = |ms| start + Duration::from_millis(ms);
        assert!(refusals.pass(&notice(1, ErrorCode::BadRequest), at(0)));
        assert!(!refusals.pass(&notice(1, ErrorCode::BadRequest), at(999)));
        assert!(refusals.pass(&notice(1, ErrorCode::Conflict), at(999)), "rubbish does not hide a reason");
        assert!(refusals.pass(&notice(2, ErrorCode::BadRequest), at(999)));
        assert!(refusals.pass(&notice(1, ErrorCode::BadRequest), at(1000)));
    }

    #[test]
    fn invented_authors_are_forgotten() {
        let (mut refusals, start) = (Refusals::new(Duration::from_secs(1)), Instant::now());
        let told = (0..5000).filter(|&author| refusals.pass(&notice(author, ErrorCode::Full), start)).count();
        assert_eq!(told, Refusals::MAX_REMEMBERED);
        assert!(refusals.pass(&notice(9999, ErrorCode::Full), start + Duration::from_secs(1)));
    }
}
