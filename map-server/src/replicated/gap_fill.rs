//! Fetches the increments that a stateless server has not received: everything at its start, and
//! later whatever was put while it had no connection. Storages are asked for the number that comes
//! after each author's last.

use crate::config::{GapFillConfig, QuorumConfig};
use crate::ingest::{Arrival, Ingest};
use crate::replicated::storages::{Held, IncrementKey, Storages};
use crate::store::StoreError;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::Head;
use fht_proto::{AuthorId, MapName};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

fn arrival(place: &IncrementKey, bytes: Vec<u8>) -> Arrival {
    Arrival { key: Key::kept(&place.map, place.author, place.number).to_string(), payload: Ok(bytes) }
}

/// Brings everything that the storages hold to a server that has nothing yet. Waits until enough
/// storages are present, and have answered completely, for the result to cover everything that was
/// ever acknowledged.
///
/// # Errors
/// [`StoreError::Unconfirmed`] when the server is told to end before that; those of
/// [`Ingest::restore`].
pub fn restore(storages: &dyn Storages, quorum: QuorumConfig, ingest: &mut Ingest) -> Result<(), StoreError> {
    let mut attempts = 0;
    while !read_all(storages, quorum, ingest)? {
        if attempts == 10 {
            let (needed, of) = (quorum.to_read(), quorum.storages);
            tracing::warn!("waiting for storages: {needed} of {of} must be there and answer to the end");
        }
        if !storages.pause(attempts) {
            return Err(StoreError::Unconfirmed);
        }
        attempts += 1;
    }
    Ok(())
}

/// Reads everything, and returns whether that was all. Reading an increment twice does no harm.
fn read_all(storages: &dyn Storages, quorum: QuorumConfig, ingest: &mut Ingest) -> Result<bool, StoreError> {
    let are_there = || storages.present() >= quorum.to_read();
    if !are_there() {
        return Ok(false);
    }
    let Some(authors) = storages.authors() else { return Ok(false) };
    for (map, author) in authors {
        let Some(all) = storages.all_of(&map, author) else { return Ok(false) };
        // What is behind a gap was not acknowledged, or is found later.
        let in_order = (1..).zip(all).take_while(|(expected, (number, _))| expected == number);
        let kept = in_order.filter_map(|(number, (_, held))| {
            let (bytes, copies) = held.most_held()?;
            Some((arrival(&IncrementKey { map: map.clone(), author, number }, bytes), copies))
        });
        ingest.restore(kept)?;
    }
    // A storage that has gone meanwhile may have sent only half of what it holds.
    Ok(are_there())
}

/// The `count` elements of `all` (in order) that come next after `last`; after the greatest comes
/// the least.
fn in_turn<T: Ord + Clone>(mut all: Vec<T>, last: &mut Option<T>, count: usize) -> Vec<T> {
    let before = all.partition_point(|one| last.as_ref().is_some_and(|last| one <= last));
    all.rotate_left(before);
    all.truncate(count);
    *last = all.last().cloned().or_else(|| last.take());
    all
}

/// The search for what was missed.
#[derive(Debug, Default)]
pub struct GapFill {
    config: GapFillConfig,
    rounds: u64,
    /// Authors of whom storages hold something and this server has nothing.
    unknown: BTreeSet<(MapName, AuthorId)>,
    /// The authors asked about last in the round before: among those known here, and among the
    /// unknown.
    cursors: [Option<(MapName, AuthorId)>; 2],
}

impl GapFill {
    /// A search that has not asked anything yet.
    #[must_use]
    pub fn new(config: GapFillConfig) -> Self {
        Self { config, ..Self::default() }
    }

    /// One round of questions by a server that has what `heads` say. Returns what the storages
    /// sent.
    pub fn find_missing(&mut self, storages: &dyn Storages, heads: &[Arc<Head>]) -> Vec<Arrival> {
        let mut known: BTreeMap<(MapName, AuthorId), u64> = BTreeMap::new();
        for head in heads {
            known.extend(head.vector.iter().map(|(author, count)| ((head.map.clone(), author), count)));
        }
        if self.rounds.is_multiple_of(self.config.list_every.max(1)) {
            // If not all storages have answered, the next turn asks again.
            self.unknown.extend(storages.authors().into_iter().flatten());
        }
        self.unknown.retain(|author| !known.contains_key(author));
        self.rounds += 1;
        let places = self.next_places(known);
        let mut found = Vec::new();
        for (place, held) in places.iter().zip(storages.held(&places, 1)) {
            if let Some((bytes, _)) = held.most_held() {
                found.push(arrival(place, bytes));
                found.extend(self.rest_of(storages, place));
            }
        }
        found
    }

    /// The places after the last known one, of as many authors as a round takes. Unknown authors
    /// get half of the round, if there are so many.
    fn next_places(&mut self, known: BTreeMap<(MapName, AuthorId), u64>) -> Vec<IncrementKey> {
        let [of_known, of_unknown] = &mut self.cursors;
        let new = in_turn(self.unknown.iter().cloned().collect(), of_unknown, self.config.authors.div_ceil(2));
        let old = in_turn(known.keys().cloned().collect(), of_known, self.config.authors - new.len());
        let place = |of: (MapName, AuthorId)| {
            let number = known.get(&of).copied().unwrap_or(0) + 1;
            IncrementKey { map: of.0, author: of.1, number }
        };
        new.into_iter().chain(old).map(place).collect()
    }

    /// What follows an increment that was found, up to the next gap.
    fn rest_of(&self, storages: &dyn Storages, found: &IncrementKey) -> Vec<Arrival> {
        let mut rest = Vec::new();
        let end = found.number.saturating_add(self.config.max_increments);
        let mut first = found.number + 1;
        while first < end {
            let numbers = first..end.min(first + self.config.part.max(1));
            let places: Vec<IncrementKey> = numbers.map(|number| IncrementKey { number, ..found.clone() }).collect();
            let held = storages.held(&places, 1);
            let until_gap = places.iter().zip(held).map_while(|(place, held): (&IncrementKey, Held)| {
                let (bytes, _) = held.most_held()?;
                Some(arrival(place, bytes))
            });
            let before = rest.len();
            rest.extend(until_gap);
            if rest.len() - before < places.len() {
                break;
            }
            first += places.len() as u64;
        }
        rest
    }
}
