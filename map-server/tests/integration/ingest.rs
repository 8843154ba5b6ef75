//! Ingest and store without a network: what is acknowledged is stored; what is refused changes
//! nothing.

use crate::support::{ANA, BEN, bytes, expected, increment, key, museum, node};
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head};
use fht_proto::codec::envelope::{FORMAT_VERSION, Message, seal};
use fht_proto::{AuthorId, Increment, MapName, Op, encode};
use map_server::catalog::Catalog;
use map_server::config::Limits;
use map_server::ingest::{Arrival, Ingest, Refusal, WriterOutcome, WriterQueue, check};
use map_server::store::{FILE_NAME, IncrementLog, IncrementOrigin, Record, RedbLog, StoreError, Stored};
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;

const NOW_US: u64 = 1_795_000_000_000_000;

fn arrival(author: AuthorId, number: u64) -> Arrival {
    Arrival { key: key(author, number), payload: Ok(bytes(author, number)) }
}

fn arrival_of(increment: &Increment) -> Arrival {
    Arrival { key: key(increment.author, increment.number), payload: Ok(encode(increment).unwrap()) }
}

struct Bench {
    store: Arc<RedbLog>,
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

impl Bench {
    fn open(dir: &Path, limits: Limits) -> Self {
        let store = Arc::new(RedbLog::open(dir).unwrap());
        let catalog = Arc::new(Catalog::load(store.as_ref()).unwrap());
        let log: Arc<dyn IncrementLog> = Arc::clone(&store) as _;
        let ingest = Ingest::new(log, Arc::clone(&catalog), limits);
        Self { store, catalog, ingest }
    }

    fn take_arrivals(&mut self, arrivals: Vec<Arrival>) -> Vec<MapName> {
        self.ingest.take_arrivals(arrivals, NOW_US).unwrap().announce.into_iter().collect()
    }

    fn head(&self) -> Head {
        self.catalog.view(&museum()).unwrap().head.as_ref().clone()
    }
}

#[test]
fn what_is_acknowledged_is_there_after_a_restart() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    assert_eq!(bench.take_arrivals((1..=20).map(|number| arrival(ANA, number)).collect()), [museum()]);
    bench.take_arrivals((1..=7).map(|number| arrival(BEN, number)).collect());
    let (state, vector) = expected(&[(ANA, 20), (BEN, 7)]);
    let head = bench.head();
    assert_eq!((head.version, &head.vector, head.digest), (27, &vector, state.digest()));
    assert_eq!((head.main_nodes, head.support_nodes, head.edges), (6, 21, 25));
    drop(bench);
    let mut bench = Bench::open(dir.path(), Limits::default());
    assert_eq!(bench.head(), head);
    bench.take_arrivals(vec![arrival(ANA, 21)]);
    assert_eq!(bench.head().version, 28);
}

#[test]
fn early_increments_are_not_acknowledged() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    assert!(bench.take_arrivals(vec![arrival(ANA, 2), arrival(ANA, 3)]).is_empty());
    assert!(bench.catalog.view(&museum()).is_none());
    bench.take_arrivals(vec![arrival(ANA, 1)]);
    assert_eq!(bench.head().version, 3);
    assert_eq!(bench.head().digest, expected(&[(ANA, 3)]).0.digest());
}

#[test]
fn repetitions_are_answered_with_the_head_and_conflicts_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    let forged = Increment { hlc_us: 5, ..increment(ANA, 1) };
    // Within one batch, and against the store.
    bench.take_arrivals(vec![arrival(ANA, 1), arrival(ANA, 1), arrival_of(&forged)]);
    assert_eq!((bench.head().version, bench.head().refused), (1, 1));
    let digest = bench.head().digest;
    assert_eq!(bench.take_arrivals(vec![arrival(ANA, 1)]), [museum()], "the writer has missed a head");
    bench.take_arrivals(vec![arrival_of(&forged)]);
    let head = bench.head();
    assert_eq!((head.version, head.refused, head.digest), (1, 2, digest));
    assert_eq!(bench.store.reader().stored(&museum(), ANA, 1).unwrap(), Stored::Increment(bytes(ANA, 1)));
}

#[test]
fn hostile_arrivals_change_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    bench.take_arrivals(vec![arrival(ANA, 1), arrival(ANA, 2)]);
    let before = bench.head();
    let good = bytes(ANA, 3);
    let with = |payload: Vec<u8>| Arrival { key: key(ANA, 3), payload: Ok(payload) };
    let at = |key: &str| Arrival { key: key.to_owned(), payload: Ok(good.clone()) };
    let mut hostile = vec![
        with(Vec::new()),
        with(b"{}".to_vec()),
        with(good[..good.len() - 1].to_vec()),
        with([good.clone(), vec![0]].concat()),
        with(vec![0xff; 3 << 20]),
        with(bytes(ANA, 4)),
        with(bytes(BEN, 3)),
        with(encode(&fht_proto::api::reply::Series::default()).unwrap()),
        Arrival { key: key(ANA, 3), payload: Err(Refusal::Delete) },
        Arrival { key: key(ANA, 1), payload: Err(Refusal::Delete) },
        at("fht/museum/inc/0000000a"),
        at("fht/museum/inc/0000000a/3/4"),
        at("fht/museum/inc/0000000A/3"),
        at("fht/museum/inc/0000000a/03"),
        at("fht/museum/inc/**"),
        arrival_of(&Increment { hlc_us: NOW_US + 7_200_000_000, ..increment(ANA, 3) }),
    ];
    let kinds = hostile.len() as u64;
    for at in 0..good.len() {
        let mut damaged = good.clone();
        damaged[at] ^= 0x40;
        hostile.push(with(damaged));
    }
    let total = hostile.len() as u64;
    assert!(bench.take_arrivals(hostile).is_empty());
    let after = bench.head();
    assert_eq!(after.refused, total, "{kinds} kinds and every byte damaged");
    assert_eq!(Head { refused: 0, ..after }, before);
    bench.take_arrivals(vec![with(good.clone())]);
    assert_eq!(bench.head().version, 3, "the true one still goes in");
}

#[test]
fn limits_hold() {
    let small = Limits { max_maps: 2, max_map_bytes: 4000, ..Limits::default() };
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), small);
    let to = |map: &str| {
        let map = map.parse().unwrap();
        Arrival { key: fht_proto::api::keys::Key::increment(&map, ANA, 1).to_string(), payload: Ok(bytes(ANA, 1)) }
    };
    assert_eq!(bench.take_arrivals(vec![to("a"), to("b"), to("c")]).len(), 2);
    assert!(bench.take_arrivals(vec![to("c")]).is_empty());
    assert_eq!(bench.catalog.heads().len(), 2);
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits { max_map_bytes: 4000, ..Limits::default() });
    bench.take_arrivals((1..=100).map(|number| arrival(ANA, number)).collect());
    assert!(bench.head().bytes <= 4000 && bench.head().refused > 0, "{:?}", bench.head());
}

#[test]
fn a_writer_is_told_why_it_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    bench.take_arrivals(vec![arrival(ANA, 1)]);
    let forged = arrival_of(&Increment { hlc_us: 5, ..increment(ANA, 1) });
    let future = arrival_of(&Increment { hlc_us: NOW_US + 7_200_000_000, ..increment(BEN, 1) });
    let elsewhere = Arrival { key: "fht/museum/inc".to_owned(), ..forged.clone() };
    let taken = bench.ingest.take_arrivals(vec![forged.clone(), forged, future, elsewhere], NOW_US).unwrap();
    let told: Vec<_> = taken.notices.iter().map(|notice| (notice.author, notice.reply.code)).collect();
    assert_eq!(told, [(ANA, ErrorCode::Conflict), (BEN, ErrorCode::Future)], "once each, and only whom a key names");
    assert!(taken.notices.iter().all(|notice| notice.reply.message.starts_with("increment 1: ")), "{taken:?}");
    for number in ["0", "02", "two", "2/x"] {
        let mut bench = Bench::open(tempfile::tempdir().unwrap().path(), Limits::default());
        let misspelt = Arrival { key: format!("fht/museum/inc/{ANA}/{number}"), ..arrival(ANA, 2) };
        let notices = bench.ingest.take_arrivals(vec![misspelt], NOW_US).unwrap().notices;
        let is_told = |reply: &ErrorReply| reply.code == ErrorCode::BadRequest && reply.message.contains("from 1 on");
        assert!(matches!(&notices[..], [told] if told.author == ANA && is_told(&told.reply)), "{number}: {notices:?}");
    }
    assert!(taken.notices.iter().all(|notice| notice.map == museum() && notice.reply.code.is_permanent_refusal()));
}

#[test]
fn what_is_stored_is_counted_apart_from_what_is_refused_or_waits() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    let forged = arrival_of(&Increment { hlc_us: 5, ..increment(ANA, 1) });
    let mut counts = |arrivals| bench.ingest.take_arrivals(arrivals, NOW_US).unwrap().written[&(museum(), ANA)];
    let first = counts(vec![arrival(ANA, 1), arrival(ANA, 2), forged, arrival(ANA, 4)]);
    assert_eq!(first, WriterOutcome { stored: 2, refused: 1 }, "the last one waits");
    assert_eq!(counts(vec![arrival(ANA, 3)]), WriterOutcome { stored: 2, refused: 0 });
}

#[test]
fn a_map_that_was_written_with_a_wrong_clock_goes_on() {
    const YEAR_US: u64 = 31_536_000_000_000;
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits::default());
    let at = |author, number, hlc_us| arrival_of(&Increment { hlc_us, ..increment(author, number) });
    bench.ingest.take_arrivals(vec![at(ANA, 1, NOW_US + YEAR_US)], NOW_US + YEAR_US).unwrap();
    let clock_us = bench.head().clock_us;
    assert_eq!(clock_us, NOW_US + YEAR_US);
    // The clock is right again, and writers stamp later than all that they have seen.
    bench.take_arrivals(vec![at(BEN, 1, clock_us + 1), at(BEN, 2, clock_us + 2), at(ANA, 2, clock_us + 1)]);
    assert_eq!((bench.head().version, bench.head().refused), (4, 0));
    // That lets nobody stamp as he likes, nor on another map.
    let refused = bench.ingest.take_arrivals(vec![at(BEN, 3, clock_us + 1_000_000)], NOW_US).unwrap();
    assert_eq!(refused.notices[0].reply.code, ErrorCode::Future);
    let elsewhere: MapName = "attic".parse().unwrap();
    let key = fht_proto::api::keys::Key::increment(&elsewhere, BEN, 1).to_string();
    let payload = at(BEN, 1, clock_us + 1).payload;
    assert!(bench.take_arrivals(vec![Arrival { key, payload }]).is_empty());
}

#[test]
fn invented_map_names_keep_nobody_out() {
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), Limits { max_pending_bytes: 100_000, ..Limits::default() });
    let to = |map: &str, number| {
        let map = map.parse().unwrap();
        let key = fht_proto::api::keys::Key::increment(&map, ANA, number).to_string();
        Arrival { key, payload: Ok(bytes(ANA, number)) }
    };
    for index in 0..2000 {
        assert!(bench.take_arrivals(vec![to(&format!("invented{index}"), 2)]).is_empty());
    }
    assert!(bench.catalog.heads().is_empty());
    assert_eq!(bench.take_arrivals(vec![to("honest", 1)]).len(), 1);
    // The last increment kept is still there.
    bench.take_arrivals(vec![to("late", 3), to("late", 2), to("late", 1)]);
    assert_eq!(bench.catalog.view(&"late".parse().unwrap()).unwrap().head.version, 3);
}

/// Many small operations: three bytes each on the wire, about a hundred in memory.
fn crowd(author: AuthorId, number: u64, first: u32, count: u32) -> Increment {
    let ops = (first..first + count).map(|id| Op::RemoveNode { id: node(author, id) }).collect();
    Increment { ops, ..increment(author, number) }
}

#[test]
fn elements_are_limited_whatever_they_weigh_on_the_wire() {
    let limits = Limits { max_map_elements: 1000, max_total_elements: 1500, ..Limits::default() };
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), limits.clone());
    let crowds: Vec<Arrival> = (1..=5).map(|n| arrival_of(&crowd(ANA, n, n as u32 * 400, 400))).collect();
    bench.take_arrivals(crowds);
    assert_eq!((bench.head().version, bench.head().refused), (2, 3), "two of 400 fit into 1000");
    // The same ones again add no elements: there is room as long as an operation could still add
    // one.
    bench.take_arrivals(vec![arrival_of(&crowd(ANA, 3, 400, 200)), arrival_of(&crowd(ANA, 4, 400, 200))]);
    assert_eq!(bench.head().version, 3);
    bench.take_arrivals(vec![arrival_of(&crowd(ANA, 4, 400, 200))]);
    assert_eq!(bench.head().version, 4, "counted anew after each batch");
    // All maps together, and after a restart.
    drop(bench);
    let mut bench = Bench::open(dir.path(), limits);
    let other = |number, count| {
        let increment = crowd(BEN, number, number as u32 * 1000, count);
        let key = fht_proto::api::keys::Key::increment(&"other".parse().unwrap(), BEN, number).to_string();
        Arrival { key, payload: Ok(encode(&increment).unwrap()) }
    };
    assert!(bench.take_arrivals(vec![other(1, 701)]).is_empty());
    assert_eq!(bench.take_arrivals(vec![other(1, 700)]).len(), 1);
}

#[test]
fn what_waits_for_a_gap_to_close_has_no_room_of_its_own() {
    let limits = Limits { max_map_elements: 1000, ..Limits::default() };
    let dir = tempfile::tempdir().unwrap();
    let mut bench = Bench::open(dir.path(), limits);
    let to_of_400 = |number: u64| arrival_of(&crowd(ANA, number, number as u32 * 400, 400));
    // Before the map begins, and when it has begun: each alone has room, all together have not.
    bench.take_arrivals(vec![to_of_400(2), to_of_400(3), to_of_400(1)]);
    assert!(bench.catalog.view(&museum()).is_none(), "1200 do not fit into 1000");
    bench.take_arrivals(vec![arrival_of(&crowd(ANA, 1, 0, 300))]);
    assert!(bench.catalog.view(&museum()).is_none(), "nor do 300 and the 800 that wait behind them");
    bench.take_arrivals(vec![arrival_of(&crowd(BEN, 1, 0, 100)), to_of_400(3), to_of_400(2)]);
    bench.take_arrivals(vec![arrival_of(&crowd(ANA, 1, 0, 200))]);
    assert_eq!(bench.head().version, 1, "100 of ben, 200 of ana and 800 that wait");
    bench.take_arrivals(vec![arrival_of(&crowd(ANA, 1, 0, 50))]);
    assert_eq!(bench.head().version, 4, "100, 50 and 800 fit");
}

#[test]
fn what_waits_is_charged_as_it_is_in_memory() {
    let dir = tempfile::tempdir().unwrap();
    let mut limits = Limits::default();
    limits.early.max_waiting_bytes = 1 << 20;
    let mut bench = Bench::open(dir.path(), limits);
    bench.take_arrivals(vec![arrival(ANA, 1)]);
    // Twenty increments of 4096 small operations: 16 KB each on the wire, about 300 KB in memory.
    bench.take_arrivals((3..=22).map(|number| arrival_of(&crowd(ANA, number, 0, 4096))).collect());
    bench.take_arrivals(vec![arrival(ANA, 2)]);
    let kept = bench.head().version - 2;
    assert!((1..5).contains(&kept), "{kept} waited");
}

#[test]
fn only_the_canonical_form_is_taken() {
    // The same increment with its own author spelled out like a foreign one: it decodes, but
    // encodes to other bytes.
    let one = Increment { ops: vec![Op::RemoveNode { id: node(ANA, 1) }], ..increment(ANA, 1) };
    let canonical = encode(&one).unwrap();
    let mut body = canonical[6..canonical.len() - 4].to_vec();
    let id = body.len() - 1;
    assert_eq!(body[id], 4, "an own node, one up");
    body.splice(id.., [3, 0xa]);
    let forged = seal(FORMAT_VERSION, Increment::KIND, &body).unwrap();
    assert_eq!(fht_proto::decode::<Increment>(&forged).unwrap(), one);
    let arrival = Arrival { key: key(ANA, 1), payload: Ok(forged) };
    assert_eq!(check(arrival, &Limits::default()), Err(Refusal::NotCanonical));
}

fn record(number: u64, bytes: Vec<u8>) -> Record {
    Record { map: museum(), sequence: 1, author: ANA, number, bytes, origin: IncrementOrigin::Writer }
}

#[test]
fn a_damaged_store_is_not_served() {
    for damage in [record(1, b"junk".to_vec()), record(2, bytes(ANA, 2)), record(1, bytes(ANA, 2))] {
        let dir = tempfile::tempdir().unwrap();
        let store = RedbLog::open(dir.path()).unwrap();
        store.append(&[damage]).unwrap();
        assert!(matches!(Catalog::load(&store), Err(StoreError::Damaged { .. })));
    }
}

#[test]
fn a_later_format_is_told_from_damage() {
    let dir = tempfile::tempdir().unwrap();
    let store = RedbLog::open(dir.path()).unwrap();
    let mut newer = bytes(ANA, 1);
    newer[3] = FORMAT_VERSION + 1;
    store.append(&[record(1, newer)]).unwrap();
    let error = Catalog::load(&store).unwrap_err();
    assert!(matches!(error, StoreError::IncrementFormat { found, .. } if found == FORMAT_VERSION + 1), "{error}");
    drop(store);
    let database = redb::Database::open(dir.path().join(FILE_NAME)).unwrap();
    let write = database.begin_write().unwrap();
    write.open_table(redb::TableDefinition::<&str, u64>::new("meta")).unwrap().insert("format", 7).unwrap();
    write.commit().unwrap();
    drop(database);
    let error = RedbLog::open(dir.path()).unwrap_err();
    assert!(matches!(error, StoreError::Format { found: 7, .. }), "{error}");
}

#[test]
fn a_store_has_one_owner_at_a_time() {
    let dir = tempfile::tempdir().unwrap();
    let store = RedbLog::open(dir.path()).unwrap();
    assert!(matches!(RedbLog::open(dir.path()), Err(StoreError::InUse { .. })));
    drop(store);
    RedbLog::open(dir.path()).unwrap();
}

#[test]
fn the_queue_is_bounded_and_ends() {
    let queue = WriterQueue::new(3000);
    let arrival = |size| Arrival { key: "k".to_owned(), payload: Ok(vec![0; size]) };
    (0..4).for_each(|_| queue.push(arrival(1000)));
    assert_eq!(queue.take_dropped(), 2);
    assert_eq!(queue.take_work(1).unwrap().arrivals.len(), 1);
    queue.close();
    queue.push(arrival(1));
    assert_eq!(queue.take_work(usize::MAX).unwrap().arrivals.len(), 1);
    assert!(queue.take_work(usize::MAX).is_none());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_delivery_ends_in_the_same_map(
        delivery in Just((1..=12_u64).flat_map(|number| [(ANA, number), (BEN, number), (ANA, number)]).collect::<Vec<_>>()).prop_shuffle(),
        cut in 1_usize..10,
    ) {
        let dir = tempfile::tempdir().unwrap();
        let mut bench = Bench::open(dir.path(), Limits::default());
        for part in delivery.chunks(cut) {
            bench.take_arrivals(part.iter().map(|&(author, number)| arrival(author, number)).collect());
        }
        let (state, vector) = expected(&[(ANA, 12), (BEN, 12)]);
        prop_assert_eq!(bench.head().digest, state.digest());
        prop_assert_eq!(&bench.head().vector, &vector);
        let head = bench.head();
        drop(bench);
        prop_assert_eq!(Bench::open(dir.path(), Limits::default()).head(), head);
    }
}
