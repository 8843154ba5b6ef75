//! What a server tells writers whose increments it refuses because it has others of their numbers. The intake itself lets through a word a
//! second by the clock of the real machine, on which nothing may depend here; so this decides the same in simulated time.

use super::map;
use fht_proto::keys::Key;
use fht_proto::query::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, VersionVector};
use map_server::check::Arrival;
use map_server::log::{IncrementLog, Stored};
use map_server::refusals::{Notice, Refusals};
use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

/// A writer is told at most this often, as by the intake.
const PERIOD: Duration = Duration::from_secs(1);

pub(super) struct Refused {
    /// Those that wait for a gap to close: the first of each number stays.
    waiting: BTreeMap<(AuthorId, u64), Vec<u8>>,
    refusals: Refusals,
    /// What simulated time counts from.
    origin: Instant,
}

impl Refused {
    pub(super) fn new() -> Self {
        Self { waiting: BTreeMap::new(), refusals: Refusals::new(PERIOD), origin: Instant::now() }
    }

    /// Notes what is about to be taken in; returns what is offered by writers.
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

    /// Who is told, now that all was taken in: those whose increment is another than what is there, or what waits.
    pub(super) fn told(
        &mut self,
        offered: Vec<(AuthorId, u64, Vec<u8>)>,
        log: &dyn IncrementLog,
        now_us: u64,
    ) -> BTreeSet<AuthorId> {
        let now = self.origin + Duration::from_micros(now_us);
        let mut told = BTreeSet::new();
        for (author, number, bytes) in offered {
            let is_other = match log.stored(&map(), author, number) {
                Ok(Stored::Increment(stored)) => stored != bytes,
                // Nobody can tell any more.
                Ok(Stored::Folded) | Err(_) => false,
                Ok(Stored::Absent) => self.waiting.get(&(author, number)).is_some_and(|first| *first != bytes),
            };
            let notice = Notice { map: map(), author, reply: ErrorReply::new(ErrorCode::Conflict, "") };
            if is_other && self.refusals.pass(&notice, now) {
                told.insert(author);
            }
        }
        told
    }
}
