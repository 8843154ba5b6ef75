//! Servers that stand on storages, without a network: what counts as acknowledged, what is read at
//! the start, and who gives way.

use crate::support::{ANA, BEN, bytes, expected, increment, key, museum};
use fht_proto::api::keys::Key;
use fht_proto::{AuthorId, Increment, MapName, Op, encode};
use map_server::catalog::Catalog;
use map_server::config::{GapFillConfig, Limits};
use map_server::ingest::{Arrival, Ingest, Refusal};
use map_server::replicated::{GapFill, Held, IncrementKey, QuorumLog, Storages, restore, settle_disputed};
use map_server::store::{IncrementLog, StoreError};
use map_server::{QuorumConfig, ServerConfig, ServerEndpoints};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

const NOW_US: u64 = 1_795_000_000_000_000;
const QUORUM: QuorumConfig = QuorumConfig { storages: 3, confirm: 2 };

/// Three storages, some of which receive nothing.
#[derive(Debug, Default)]
struct Three {
    held: Mutex<[BTreeMap<IncrementKey, Vec<u8>>; 3]>,
    deaf: Mutex<BTreeSet<usize>>,
    /// After so many questions one receives again.
    heals: Mutex<Option<(u32, usize)>>,
    puts: Mutex<usize>,
    /// How many more questions have their answers cut off before anything arrives.
    breaks: Mutex<u32>,
}

impl Three {
    fn breaks_off(&self) -> bool {
        let mut breaks = self.breaks.lock().unwrap();
        *breaks = breaks.saturating_sub(1);
        *breaks > 0
    }

    fn hearing(&self) -> Vec<usize> {
        (0..3).filter(|storage| !self.deaf.lock().unwrap().contains(storage)).collect()
    }

    fn deafen(&self, storages: &[usize]) {
        *self.deaf.lock().unwrap() = storages.iter().copied().collect();
    }

    fn copies(&self, author: AuthorId, number: u64) -> usize {
        let place = IncrementKey { map: museum(), author, number };
        self.held.lock().unwrap().iter().filter(|held| held.contains_key(&place)).count()
    }
}

impl Storages for Three {
    fn put(&self, place: &IncrementKey, bytes: &[u8]) {
        *self.puts.lock().unwrap() += 1;
        for storage in self.hearing() {
            self.held.lock().unwrap()[storage].insert(place.clone(), bytes.to_vec());
        }
    }

    fn held(&self, places: &[IncrementKey], enough: usize) -> Vec<Held> {
        let of_place = |place: &IncrementKey| {
            let mut held = Held::default();
            for storage in self.hearing() {
                if held.answers() < enough {
                    self.held.lock().unwrap()[storage].get(place).into_iter().for_each(|bytes| held.add(bytes.clone()));
                }
            }
            held
        };
        places.iter().map(of_place).collect()
    }

    fn present(&self) -> usize {
        self.hearing().len()
    }

    fn authors(&self) -> Option<BTreeSet<(MapName, AuthorId)>> {
        if self.breaks_off() {
            return None;
        }
        let held = self.held.lock().unwrap();
        let places = self.hearing().into_iter().flat_map(|storage| held[storage].keys());
        Some(places.filter(|place| place.number == 1).map(|place| (place.map.clone(), place.author)).collect())
    }

    fn all_of(&self, map: &MapName, author: AuthorId) -> Option<BTreeMap<u64, Held>> {
        if self.breaks_off() {
            return None;
        }
        let mut all: BTreeMap<u64, Held> = BTreeMap::new();
        for storage in self.hearing() {
            for (place, bytes) in &self.held.lock().unwrap()[storage] {
                if (&place.map, place.author) == (map, author) {
                    all.entry(place.number).or_default().add(bytes.clone());
                }
            }
        }
        Some(all)
    }

    fn pause(&self, attempts: u32) -> bool {
        if let Some((_, storage)) = self.heals.lock().unwrap().filter(|(after, _)| attempts >= *after) {
            self.deaf.lock().unwrap().remove(&storage);
        }
        attempts < 50
    }
}

struct Server {
    log: Arc<QuorumLog>,
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

impl Server {
    fn new(storages: &Arc<Three>) -> Self {
        let log = Arc::new(QuorumLog::new(Arc::clone(storages) as _, QUORUM));
        let catalog = Arc::new(Catalog::default());
        let ingest = Ingest::new(Arc::clone(&log) as _, Arc::clone(&catalog), Limits::default());
        Self { log, catalog, ingest }
    }

    /// A server that has read what there is.
    fn begin(storages: &Arc<Three>) -> Self {
        let mut server = Self::new(storages);
        restore(storages.as_ref(), QUORUM, &mut server.ingest).unwrap();
        server
    }

    fn has(&self, author: AuthorId) -> u64 {
        self.catalog.view(&museum()).map_or(0, |view| view.head.vector.get(author))
    }
}

fn from_writer(author: AuthorId, number: u64) -> Arrival {
    Arrival { key: key(author, number), payload: Ok(bytes(author, number)) }
}

fn kept(increment: &Increment) -> Arrival {
    let key = Key::kept(&museum(), increment.author, increment.number).to_string();
    Arrival { key, payload: Ok(encode(increment).unwrap()) }
}

#[test]
fn what_a_head_covers_is_held_by_most_of_the_storages() {
    let storages = Arc::new(Three::default());
    let mut server = Server::begin(&storages);
    storages.deafen(&[2]);
    server.ingest.take_arrivals((1..=20).map(|number| from_writer(ANA, number)).collect(), NOW_US).unwrap();
    assert_eq!((server.has(ANA), storages.copies(ANA, 20)), (20, 2));
    // One storage is too few: nothing is acknowledged until there are two, and what the other did
    // not receive is put again.
    storages.deafen(&[1, 2]);
    *storages.heals.lock().unwrap() = Some((3, 1));
    server.ingest.take_arrivals(vec![from_writer(ANA, 21)], NOW_US).unwrap();
    assert_eq!((server.has(ANA), storages.copies(ANA, 21)), (21, 2));
    *storages.heals.lock().unwrap() = None;
    storages.deafen(&[0, 2]);
    let error = server.ingest.take_arrivals(vec![from_writer(ANA, 22)], NOW_US).unwrap_err();
    assert!(matches!(error, StoreError::Unconfirmed), "{error}");
    assert_eq!(server.has(ANA), 21);
}

#[test]
fn a_server_begins_with_all_that_was_acknowledged_whichever_storages_are_there() {
    let storages = Arc::new(Three::default());
    let mut first = Server::begin(&storages);
    for (deaf, number) in [(0, 1), (1, 2), (2, 3)] {
        storages.deafen(&[deaf]);
        first.ingest.take_arrivals(vec![from_writer(ANA, number), from_writer(BEN, number)], NOW_US).unwrap();
    }
    for deaf in 0..3 {
        storages.deafen(&[deaf]);
        let server = Server::begin(&storages);
        assert_eq!((server.has(ANA), server.has(BEN)), (3, 3), "without {deaf}");
        let head = server.catalog.view(&museum()).unwrap().head;
        assert_eq!(head.digest, expected(&[(ANA, 3), (BEN, 3)]).0.digest());
    }
    storages.deafen(&[0, 1]);
    let error = restore(storages.as_ref(), QUORUM, &mut Server::new(&storages).ingest).unwrap_err();
    assert!(matches!(error, StoreError::Unconfirmed), "one of three may have missed anything");
}

#[test]
fn what_was_missed_is_found_and_what_is_known_is_not_put_again() {
    let storages = Arc::new(Three::default());
    let (mut one, mut other) = (Server::begin(&storages), Server::begin(&storages));
    one.ingest.take_arrivals((1..=150).map(|number| from_writer(ANA, number)).collect(), NOW_US).unwrap();
    one.ingest.take_arrivals(vec![from_writer(BEN, 1)], NOW_US).unwrap();
    let puts = *storages.puts.lock().unwrap();
    let mut gaps =
        GapFill::new(GapFillConfig { part: 10, max_increments: 100, list_every: 1, ..GapFillConfig::default() });
    for _ in 0..3 {
        let found = gaps.find_missing(storages.as_ref(), &other.catalog.heads());
        let taken = other.ingest.take_arrivals(found, 0).unwrap();
        assert!(taken.disputed.is_empty() && taken.notices.is_empty());
    }
    assert_eq!((other.has(ANA), other.has(BEN)), (150, 1));
    assert_eq!(one.catalog.heads()[0].digest, other.catalog.heads()[0].digest);
    assert!(gaps.find_missing(storages.as_ref(), &other.catalog.heads()).is_empty());
    assert_eq!(*storages.puts.lock().unwrap(), puts);
}

#[test]
fn an_answer_that_breaks_off_is_not_taken_for_an_empty_one() {
    let storages = Arc::new(Three::default());
    Server::begin(&storages).ingest.take_arrivals(vec![from_writer(ANA, 1), from_writer(BEN, 1)], NOW_US).unwrap();
    for breaks in 0..8 {
        *storages.breaks.lock().unwrap() = breaks;
        let server = Server::begin(&storages);
        assert_eq!((server.has(ANA), server.has(BEN)), (1, 1), "after {breaks}");
    }
    *storages.breaks.lock().unwrap() = 1000;
    let error = restore(storages.as_ref(), QUORUM, &mut Server::new(&storages).ingest).unwrap_err();
    assert!(matches!(error, StoreError::Unconfirmed), "{error}");
}

#[test]
fn an_author_whose_beginning_was_missed_is_found_however_many_there_are() {
    for authors in [64, 80, 96, 120, 160, 240, 480] {
        let storages = Arc::new(Three::default());
        let (mut one, mut other) = (Server::begin(&storages), Server::begin(&storages));
        let known: Vec<Arrival> = (0..authors).map(|number| from_writer(AuthorId(1000 + 10 * number), 1)).collect();
        one.ingest.take_arrivals(known.clone(), NOW_US).unwrap();
        other.ingest.take_arrivals(known, NOW_US).unwrap();
        let missing = AuthorId(1000 + 10 * (authors - 5) + 3);
        one.ingest.take_arrivals(vec![from_writer(missing, 1)], NOW_US).unwrap();
        let mut gaps = GapFill::new(GapFillConfig::default());
        // It was listed before, and is listed again.
        for _ in 0..20 {
            let found = gaps.find_missing(storages.as_ref(), &other.catalog.heads());
            other.ingest.take_arrivals(found, 0).unwrap();
        }
        assert_eq!(other.has(missing), 1, "one of {authors}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_waits_for_its_storages_ends_when_it_is_told() {
    let link = ServerEndpoints { listen: vec![crate::support::free_endpoint()], ..Default::default() };
    let config = ServerConfig { storages: Some(QUORUM), ..ServerConfig::new(std::path::PathBuf::new(), link) };
    let told = tokio::time::sleep(std::time::Duration::from_secs(1));
    tokio::time::timeout(std::time::Duration::from_secs(30), map_server::run(config, told)).await.unwrap().unwrap();
}

#[test]
fn of_two_increments_put_at_one_time_everybody_ends_with_the_lesser() {
    let [less, more] = {
        let mut two = [
            increment(ANA, 1),
            Increment { ops: vec![Op::RemoveNode { id: crate::support::node(BEN, 1) }], ..increment(ANA, 1) },
        ];
        two.sort_by_key(|increment| encode(increment).unwrap());
        two
    };
    let place = IncrementKey { map: museum(), author: ANA, number: 1 };
    let arrival = |increment: &Increment| Arrival { key: key(ANA, 1), payload: Ok(encode(increment).unwrap()) };
    // At the same time: neither saw what the other put.
    let (storages, elsewhere) = (Arc::new(Three::default()), Arc::new(Three::default()));
    let (mut has_less, mut has_more) = (Server::begin(&storages), Server::begin(&elsewhere));
    has_less.ingest.take_arrivals(vec![arrival(&less)], NOW_US).unwrap();
    has_more.ingest.take_arrivals(vec![arrival(&more)], NOW_US).unwrap();
    storages.put(&place, &encode(&more).unwrap());
    // The server with the lesser bytes puts them in place of the other's.
    let taken = has_less.ingest.take_arrivals(vec![kept(&more)], NOW_US).unwrap();
    assert_eq!(taken.disputed.len(), 1);
    settle_disputed(&taken.disputed, has_less.log.as_ref(), storages.as_ref()).unwrap();
    // The other server gives way, and reads everything anew.
    let taken = has_more.ingest.take_arrivals(vec![kept(&less)], NOW_US).unwrap();
    let error = settle_disputed(&taken.disputed, has_more.log.as_ref(), storages.as_ref()).unwrap_err();
    assert!(matches!(error, StoreError::Overruled { author: ANA, number: 1, .. }), "{error}");
    let anew = Server::begin(&storages);
    assert_eq!(anew.catalog.heads()[0].digest, has_less.catalog.heads()[0].digest);
}

#[test]
fn what_storages_hold_already_stays_whatever_a_server_has_not_heard_of() {
    let storages = Arc::new(Three::default());
    Server::begin(&storages).ingest.take_arrivals(vec![from_writer(ANA, 1)], NOW_US).unwrap();
    let puts = *storages.puts.lock().unwrap();
    // A writer that continues where a server that is behind says that it is.
    let other = Increment { ops: vec![Op::RemoveNode { id: crate::support::node(BEN, 1) }], ..increment(ANA, 1) };
    let arrival = Arrival { key: key(ANA, 1), payload: Ok(encode(&other).unwrap()) };
    let error = Server::new(&storages).ingest.take_arrivals(vec![arrival], NOW_US).unwrap_err();
    assert!(matches!(error, StoreError::Overruled { .. }), "{error}");
    assert_eq!(*storages.puts.lock().unwrap(), puts);
    let notices = Server::begin(&storages).ingest.take_arrivals(vec![from_writer(ANA, 1)], NOW_US).unwrap().notices;
    assert!(notices.is_empty(), "what was there is there");
}

#[test]
fn rubbish_in_a_storage_stands_in_nobodys_way() {
    let storages = Arc::new(Three::default());
    storages.put(&IncrementKey { map: museum(), author: ANA, number: 1 }, b"");
    let mut server = Server::begin(&storages);
    assert_eq!(server.has(ANA), 0);
    server.ingest.take_arrivals(vec![from_writer(ANA, 1)], NOW_US).unwrap();
    assert_eq!((server.has(ANA), Server::begin(&storages).has(ANA)), (1, 1));
}

#[test]
fn what_a_server_has_let_in_is_let_in_by_all_and_nothing_is_folded() {
    let storages = Arc::new(Three::default());
    let mut server = Server::begin(&storages);
    // Far ahead of this server's clock, and over its limits.
    let mut later = increment(ANA, 1);
    later.hlc_us = 1 << 52;
    let refused = server
        .ingest
        .take_arrivals(vec![Arrival { key: key(ANA, 1), payload: Ok(encode(&later).unwrap()) }], 0)
        .unwrap();
    assert_eq!(refused.notices.len(), 1);
    storages.put(&IncrementKey { map: museum(), author: ANA, number: 1 }, &encode(&later).unwrap());
    server.ingest.take_arrivals(vec![kept(&later)], 0).unwrap();
    assert_eq!(server.has(ANA), 1);
    assert!(server.log.is_shared());
    let fold = fht_proto::CompactedSeries { author: BEN, first: 1, last: 2, rests: Vec::new() };
    let series = fht_proto::api::reply::Series { folds: vec![fold], ..Default::default() };
    assert_eq!(server.ingest.import(&"other".parse().unwrap(), series, NOW_US).unwrap(), Err(Refusal::CompactedShared));
}
