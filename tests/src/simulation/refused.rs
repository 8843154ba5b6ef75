//! What a server tells writers whose increments it refuses because it has others with their
//! numbers. The real ingest limits these notices by the real clock, on which nothing may depend
//! here; so this decides the same in simulated time.

use crate::simulation::message::map;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, VersionVector};
use map_server::ingest::{Arrival, RefusalNotice, RefusalThrottle};
use map_server::store::{IncrementLog, Stored};
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

/// The shortest time between two notices to a writer, as in the real ingest.
const PERIOD: Duration = Duration::from_secs(1);

pub(super) struct Refused {
    /// Increments that wait for a gap to close: the first of each number stays.
    waiting: BTreeMap<(AuthorId, u64), Vec<u8>>,
    refusals: RefusalThrottle,
    /// What simulated time counts from.
    origin: Instant,
}

impl Refused {
    pub(super) fn new() -> Self {
        Self { waiting: BTreeMap::new(), refusals: RefusalThrottle::new(PERIOD), origin: Instant::now() }
    }

    /// Notes what is about to be taken in; returns what writers offer.
    pub(super) fn offered(&mut self, arrivals: &[Arrival], vector: &VersionVector) -> Vec<(AuthorId, u64, Vec<u8>)> {
        self.waiting.retain(|(author, number), _| *number > vector.get(*author));
        let offered = arrivals.iter().filter_map(|arrival| {
            let Ok(Key::Increment { author, number, .. }) = arrival.key.parse() else { return None };
            Some((author, number, arrival.payload.as_ref().ok()?.clone()))
        });
        let offered: Vec<_> = offered.collect();
        for (author, number, bytes) in &offered {
            if *number > vector.get(*author) {
                self.waiting.entry((*author, *number)).or_insert_with(|| bytes.clone());
            }
        }
        offered
    }

    /// Who is told, after everything was taken in: writers whose increment differs from what is
    /// stored, or from what waits.
    pub(super) fn told(
        &mut self,
        offered: Vec<(AuthorId, u64, Vec<u8>)>,
        log: &dyn IncrementLog,
        now_us: u64,
    ) -> BTreeSet<AuthorId> {
        let now = self.origin + Duration::from_micros(now_us);
        let mut told = BTreeSet::new();
        for (author, number, bytes) in offered {
            let is_other = match log.reader().stored(&map(), author, number) {
                Ok(Stored::Increment(stored)) => stored != bytes,
                // It cannot be told any more.
                Ok(Stored::Compacted) | Err(_) => false,
                Ok(Stored::Absent) => self.waiting.get(&(author, number)).is_some_and(|first| *first != bytes),
            };
            let notice = RefusalNotice { map: map(), author, reply: ErrorReply::new(ErrorCode::Conflict, "") };
            if is_other && self.refusals.pass(&notice, now) {
                told.insert(author);
            }
        }
        told
    }
}
