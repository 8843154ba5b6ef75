//! What a stateless server has not heard: everything at its start, and later on what was put while it had no connection. Storages are
//! asked for the number that comes next after each author's last.

use crate::check::Arrival;
use crate::ingest::Ingest;
use crate::log::StoreError;
use crate::storages::{Held, Place, QuorumConfig, Storages};
use fht_proto::keys::Key;
use fht_proto::query::Head;
use fht_proto::{AuthorId, MapName};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// How much is asked at a time.
#[derive(Clone, Debug)]
pub struct CatchUpConfig {
    /// Authors that are looked after in a round. Default 64; with more of them it takes several rounds to ask for all.
    pub authors: usize,
    /// Increments of one author that are fetched at a time, once there is one. Default 64.
    pub part: u64,
    /// … and in one round. Default 1024.
    pub max_increments: u64,
    /// Authors of whom nothing is here are looked for every so many rounds. Default 15: storages go through all of their keys for it.
    pub list_every: u64,
}

impl Default for CatchUpConfig {
    fn default() -> Self {
        Self { authors: 64, part: 64, max_increments: 1024, list_every: 15 }
    }
}

fn arrival(place: &Place, bytes: Vec<u8>) -> Arrival {
    Arrival { key: Key::kept(&place.map, place.author, place.number).to_string(), payload: Ok(bytes) }
}

/// Brings all that the storages hold to a server that has nothing yet. Waits until enough of them are there, and have answered to the end,
/// for it to be all that was ever acknowledged.
///
/// # Errors
/// [`StoreError::Unconfirmed`] when the server is told to end before; those of [`Ingest::restore`].
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

/// Reads everything; whether that was all. What is read twice does no harm.
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
            let (bytes, copies) = held.most()?;
            Some((arrival(&Place { map: map.clone(), author, number }, bytes), copies))
        });
        ingest.restore(kept)?;
    }
    // One that has gone meanwhile may have said half of what it holds.
    Ok(are_there())
}

/// The `count` that come next after `last`, of some in order; after the greatest comes the least.
fn in_turn<T: Ord + Clone>(mut all: Vec<T>, last: &mut Option<T>, count: usize) -> Vec<T> {
    let before = all.partition_point(|one| last.as_ref().is_some_and(|last| one <= last));
    all.rotate_left(before);
    all.truncate(count);
    *last = all.last().cloned().or_else(|| last.take());
    all
}

/// What was missed.
#[derive(Debug, Default)]
pub struct CatchUp {
    config: CatchUpConfig,
    rounds: u64,
    /// Authors of whom storages hold something, and nothing is here.
    unknown: BTreeSet<(MapName, AuthorId)>,
    /// The last that were asked for in the round before: of those who are known, and of those who are not.
    cursors: [Option<(MapName, AuthorId)>; 2],
}

impl CatchUp {
    /// Nothing was asked yet.
    #[must_use]
    pub fn new(config: CatchUpConfig) -> Self {
        Self { config, ..Self::default() }
    }

    /// One round of questions by a server that has what `heads` say. Returns what they have brought.
    pub fn look(&mut self, storages: &dyn Storages, heads: &[Arc<Head>]) -> Vec<Arrival> {
        let mut known: BTreeMap<(MapName, AuthorId), u64> = BTreeMap::new();
        for head in heads {
            known.extend(head.vector.iter().map(|(author, count)| ((head.map.clone(), author), count)));
        }
        if self.rounds.is_multiple_of(self.config.list_every.max(1)) {
            // If not all have answered, in the next turn.
            self.unknown.extend(storages.authors().into_iter().flatten());
        }
        self.unknown.retain(|author| !known.contains_key(author));
        self.rounds += 1;
        let places = self.next_places(known);
        let mut found = Vec::new();
        for (place, held) in places.iter().zip(storages.held(&places, 1)) {
            if let Some((bytes, _)) = held.most() {
                found.push(arrival(place, bytes));
                found.extend(self.rest_of(storages, place));
            }
        }
        found
    }

    /// The places after the last that is known, of as many authors as there are in a round: those of whom nothing is here get half of it, if
    /// there are so many.
    fn next_places(&mut self, known: BTreeMap<(MapName, AuthorId), u64>) -> Vec<Place> {
        let [of_known, of_unknown] = &mut self.cursors;
        let new = in_turn(self.unknown.iter().cloned().collect(), of_unknown, self.config.authors.div_ceil(2));
        let old = in_turn(known.keys().cloned().collect(), of_known, self.config.authors - new.len());
        let place = |of: (MapName, AuthorId)| {
            let number = known.get(&of).copied().unwrap_or(0) + 1;
            Place { map: of.0, author: of.1, number }
        };
        new.into_iter().chain(old).map(place).collect()
    }

    /// What follows an increment that was found, up to the next gap.
    fn rest_of(&self, storages: &dyn Storages, found: &Place) -> Vec<Arrival> {
        let mut rest = Vec::new();
        let end = found.number.saturating_add(self.config.max_increments);
        let mut first = found.number + 1;
        while first < end {
            let numbers = first..end.min(first + self.config.part.max(1));
            let places: Vec<Place> = numbers.map(|number| Place { number, ..found.clone() }).collect();
            let held = storages.held(&places, 1);
            let until_gap = places.iter().zip(held).map_while(|(place, held): (&Place, Held)| {
                let (bytes, _) = held.most()?;
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
