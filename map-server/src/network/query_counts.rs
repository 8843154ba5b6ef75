//! How many questions of each kind there were, what came of them, and how long they took.

use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Instant;

/// How long a question may take to be counted among the quick ones, and so on, microseconds.
const UPTO_US: [u64; 9] = [500, 1_000, 2_500, 10_000, 50_000, 250_000, 1_000_000, 5_000_000, 10_000_000];

/// Kinds: the topics, and the list of maps.
const KINDS: usize = Topic::ALL.len() + 1;

#[derive(Debug, Default)]
struct OfKind {
    answered: AtomicU64,
    refused: AtomicU64,
    busy: AtomicU64,
    total_us: AtomicU64,
    by_time: [AtomicU64; UPTO_US.len() + 1],
}

/// The counters.
#[derive(Debug, Default)]
pub(crate) struct QueryCounts([OfKind; KINDS]);

/// The kind of question that a key asks, if it is one.
fn kind_of(key: &str) -> Option<usize> {
    match key.parse() {
        Ok(Key::Maps) => Some(0),
        Ok(Key::Topic { topic, .. }) => Topic::ALL.iter().position(|known| *known == topic).map(|at| at + 1),
        _ => None,
    }
}

impl QueryCounts {
    /// A question that came at `begun` under `key` is answered, or refused.
    pub(super) fn note(&self, key: &str, refusal: Option<&ErrorReply>, begun: Instant) {
        let Some(of) = kind_of(key).and_then(|kind| self.0.get(kind)) else { return };
        let outcome = match refusal.map(|refusal| refusal.code) {
            None => &of.answered,
            Some(ErrorCode::Busy) => &of.busy,
            Some(_) => &of.refused,
        };
        outcome.fetch_add(1, Relaxed);
        let took_us = u64::try_from(begun.elapsed().as_micros()).unwrap_or(u64::MAX);
        of.total_us.fetch_add(took_us, Relaxed);
        let slot = UPTO_US.iter().position(|upto_us| took_us <= *upto_us).unwrap_or(UPTO_US.len());
        of.by_time[slot].fetch_add(1, Relaxed);
    }
}

/// What was counted of the questions of one kind.
#[cfg(feature = "web")]
pub(crate) struct CountedQueries {
    pub(crate) topic: &'static str,
    pub(crate) answered: u64,
    pub(crate) refused: u64,
    pub(crate) busy: u64,
    /// All together.
    pub(crate) seconds: f64,
    /// How many took at most so many seconds, and longer than those before.
    pub(crate) by_time: Vec<(f64, u64)>,
}

#[cfg(feature = "web")]
impl QueryCounts {
    /// What was counted so far.
    pub(crate) fn all(&self) -> Vec<CountedQueries> {
        let upto_s = || UPTO_US.iter().map(|us| *us as f64 / 1e6).chain([f64::INFINITY]);
        let names = ["maps"].into_iter().chain(Topic::ALL.map(Topic::as_str));
        let counted = |(topic, of): (&'static str, &OfKind)| CountedQueries {
            topic,
            answered: of.answered.load(Relaxed),
            refused: of.refused.load(Relaxed),
            busy: of.busy.load(Relaxed),
            seconds: of.total_us.load(Relaxed) as f64 * 1e-6,
            by_time: upto_s().zip(of.by_time.iter().map(|count| count.load(Relaxed))).collect(),
        };
        names.zip(&self.0).map(counted).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_counted_by_what_came_of_it() {
        let counts = QueryCounts::default();
        let busy = ErrorReply::busy("later", 1);
        let wrong = ErrorReply::new(ErrorCode::UnknownMap, "no");
        for (key, refusal) in [
            ("fht/maps", None),
            ("fht/m/path", None),
            ("fht/m/path", Some(&busy)),
            ("fht/n/path", Some(&wrong)),
            ("fht/m/admin/retain", None),
            ("fht/**", Some(&wrong)),
        ] {
            counts.note(key, refusal, Instant::now());
        }
        let path = &counts.0[kind_of("fht/m/path").unwrap_or_default()];
        let loaded = [&path.answered, &path.busy, &path.refused].map(|count| count.load(Relaxed));
        assert_eq!((counts.0[0].answered.load(Relaxed), loaded), (1, [1, 1, 1]));
        assert_eq!(path.by_time.iter().map(|count| count.load(Relaxed)).sum::<u64>(), 3);
    }
}
