//! Compaction, export and import over both logs: releases and heads stay what they are, a compacted
//! map can be moved, and old data directories are read.

use crate::support::{ANA, BEN, increment, key, museum, node};
use fht_map::MapState;
use fht_proto::api::reply::Series;
use fht_proto::{FixedPose, Increment, MapName, Op, Release, ReleaseName, VersionVector, decode, encode};
use map_server::catalog::{Catalog, PlanningState, state_at};
use map_server::config::Limits;
use map_server::ingest::{Arrival, Ingest};
use map_server::store::{FILE_NAME, IncrementLog, MemoryLog, RedbLog, Stored};
use std::sync::Arc;

const NOW_US: u64 = 1_795_000_000_000_000;

struct Server {
    log: Arc<dyn IncrementLog>,
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

impl Server {
    fn on(log: Arc<dyn IncrementLog>) -> Self {
        let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
        let ingest = Ingest::new(Arc::clone(&log), Arc::clone(&catalog), Limits::default());
        Self { log, catalog, ingest }
    }

    fn take_increment(&mut self, increment: &Increment) {
        let key = key(increment.author, increment.number);
        let arrival = Arrival { key, payload: Ok(encode(increment).unwrap()) };
        assert!(self.ingest.take_arrivals(vec![arrival], NOW_US).unwrap().notices.is_empty());
    }

    fn state(&self) -> Arc<MapState> {
        self.catalog.view(&museum()).unwrap().state
    }

    fn vector(&self) -> VersionVector {
        self.catalog.view(&museum()).unwrap().head.vector.clone()
    }

    /// A robot drives on, and now and then moves all its nodes a little.
    fn drive(&mut self, from: u64, to: u64) {
        for number in from..=to {
            let mut increment = increment(ANA, number);
            increment.ops.extend((0..number as u32 - 1).map(|moved| Op::SetPose {
                id: node(ANA, moved),
                pose: FixedPose::from_metres(f64::from(moved), number as f64 * 0.001, 0.0),
            }));
            self.take_increment(&increment);
        }
    }

    fn release(&mut self, number: u64, name: &str) -> Release {
        let name: ReleaseName = name.parse().unwrap();
        let release = Release { vector: self.vector(), digest: self.state().digest() };
        let ops = vec![Op::PutRelease { name, release: release.clone() }];
        self.take_increment(&Increment { author: BEN, number, hlc_us: 2_000_000 + number, ops });
        release
    }
}

fn is_whole(release: &Release, log: &dyn IncrementLog) -> bool {
    state_at(&museum(), &release.vector, log).unwrap().is_some_and(|state| state.digest() == release.digest)
}

fn lacking(log: &dyn IncrementLog, have: &VersionVector, upto: &VersionVector) -> Series {
    let lacking = log.reader().lacking(&museum(), have, upto, usize::MAX).unwrap();
    Series {
        folds: lacking.compacted.iter().map(|bytes| decode(bytes).unwrap()).collect(),
        increments: lacking.increments.iter().map(|bytes| decode(bytes).unwrap()).collect(),
    }
}

fn life_of_a_map(log: Arc<dyn IncrementLog>) -> Server {
    let mut server = Server::on(log);
    server.drive(1, 30);
    let first = server.release(1, "first");
    server.drive(31, 60);
    let second = server.release(2, "second");
    server.drive(61, 90);
    let before = (server.state().digest(), server.catalog.view(&museum()).unwrap().head.bytes);
    let retained = server.ingest.retain(&museum(), 10).unwrap().unwrap();
    assert_eq!((retained.oldest_version, retained.folded), (82, 82));
    assert!(retained.bytes * 2 < retained.bytes_before, "{retained:?}");
    let head = server.catalog.view(&museum()).unwrap().head;
    assert_eq!((head.version, head.digest, retained.bytes_before), (92, before.0, before.1));
    for release in [&first, &second] {
        assert!(is_whole(release, server.log.as_ref()));
    }
    assert_eq!(server.log.reader().vector_at(&museum(), 81).unwrap(), None, "folded away");
    let mut vector = server.log.reader().vector_at(&museum(), 82).unwrap().unwrap();
    assert_eq!((vector.get(ANA), vector.get(BEN)), (80, 2));
    assert_eq!(server.log.reader().stored(&museum(), ANA, 5).unwrap(), Stored::Compacted);
    // It goes on, and is compacted again: less remains of what was in between.
    server.drive(91, 120);
    assert_eq!(server.ingest.retain(&museum(), 0).unwrap().unwrap().folded, 40);
    for release in [&first, &second] {
        assert!(is_whole(release, server.log.as_ref()));
    }
    vector = server.vector();
    let expected = server.state().digest();
    assert_eq!(state_at(&museum(), &vector, server.log.as_ref()).unwrap().unwrap().digest(), expected);
    // A writer that sends a compacted increment again is told the head, and nothing changes.
    server.take_increment(&increment(ANA, 7));
    assert_eq!(server.state().digest(), expected);
    server
}

#[test]
fn releases_outlive_folding_in_a_file() {
    let dir = tempfile::tempdir().unwrap();
    let server = life_of_a_map(Arc::new(RedbLog::open(dir.path()).unwrap()));
    let head = server.catalog.view(&museum()).unwrap().head;
    drop(server);
    let again = Server::on(Arc::new(RedbLog::open(dir.path()).unwrap()));
    assert_eq!(again.catalog.view(&museum()).unwrap().head, head, "after a restart");
}

#[test]
fn releases_outlive_folding_in_memory() {
    life_of_a_map(Arc::new(MemoryLog::new()));
}

#[test]
fn a_folded_map_can_be_moved() {
    let mut from = life_of_a_map(Arc::new(MemoryLog::new()));
    from.drive(121, 130);
    let dir = tempfile::tempdir().unwrap();
    let mut to = Server::on(Arc::new(RedbLog::open(dir.path()).unwrap()));
    let whole = lacking(from.log.as_ref(), &VersionVector::default(), &from.vector());
    assert!(!whole.folds.is_empty() && whole.increments.len() == 10);
    // In pieces, and each piece twice.
    let pieces = whole.folds.into_iter().map(|fold| Series { folds: vec![fold], increments: Vec::new() });
    for piece in pieces.chain([Series { folds: Vec::new(), increments: whole.increments }]) {
        to.ingest.import(&museum(), piece.clone(), NOW_US).unwrap().unwrap();
        to.ingest.import(&museum(), piece, NOW_US).unwrap().unwrap();
    }
    assert_eq!((to.vector(), to.state().digest()), (from.vector(), from.state().digest()));
    let releases: Vec<Release> = to.state().annotations().releases().map(|it| it.release.clone()).collect();
    assert_eq!(releases.len(), 2);
    assert!(releases.iter().all(|release| is_whole(release, to.log.as_ref())));
    to.drive(131, 135);
    from.drive(131, 135);
    assert_eq!(to.state().digest(), from.state().digest(), "both go on alike");
}

#[test]
fn folds_do_not_go_into_a_map_that_has_others() {
    let from = life_of_a_map(Arc::new(MemoryLog::new()));
    let whole = lacking(from.log.as_ref(), &VersionVector::default(), &from.vector());
    let mut to = Server::on(Arc::new(MemoryLog::new()));
    to.take_increment(&increment(BEN, 1));
    let before = to.catalog.view(&museum()).unwrap().head;
    let refusal = to.ingest.import(&museum(), whole, NOW_US).unwrap().unwrap_err();
    assert!(refusal.to_string().contains("another name"), "{refusal}");
    assert_eq!(to.catalog.view(&museum()).unwrap().head, before);
}

#[test]
fn a_fold_that_honest_writers_cannot_go_on_from_is_refused() {
    let from = life_of_a_map(Arc::new(MemoryLog::new()));
    let mut whole = lacking(from.log.as_ref(), &VersionVector::default(), &from.vector());
    let mut endless = whole.folds[0].clone();
    endless.last = u64::MAX;
    let bytes = fht_proto::encode(&endless);
    assert!(
        bytes.is_err() || fht_proto::decode::<fht_proto::CompactedSeries>(&bytes.unwrap()).is_err(),
        "its numbers end nowhere"
    );
    whole.folds[0].rests[0].hlc_us = NOW_US + 86_400_000_000;
    let mut to = Server::on(Arc::new(MemoryLog::new()));
    let refusal = to.ingest.import(&museum(), whole, NOW_US).unwrap().unwrap_err();
    assert!(refusal.to_string().contains("ahead"), "{refusal}");
    assert!(to.catalog.view(&museum()).is_none());
}

#[test]
fn the_release_that_is_enabled_is_what_robots_use() {
    let mut server = Server::on(Arc::new(MemoryLog::new()));
    server.drive(1, 10);
    let first = server.release(1, "first");
    server.drive(11, 20);
    let running = |server: &Server| -> Arc<PlanningState> { server.catalog.view(&museum()).unwrap().running };
    assert_eq!((running(&server).release(), running(&server).version()), (None, 21));
    let id: fht_proto::ReleaseId = format!("first@{BEN}").parse().unwrap();
    let enable = |release| Op::Enable { release };
    server.take_increment(&Increment {
        author: BEN,
        number: 2,
        hlc_us: 3_000_000,
        ops: vec![enable(Some(id.clone()))],
    });
    assert_eq!((running(&server).release(), running(&server).version()), (Some(&id), 10));
    assert_eq!(running(&server).state().digest(), first.digest);
    server.drive(21, 22);
    assert_eq!(running(&server).version(), 10, "whatever comes later");
    server.take_increment(&Increment { author: BEN, number: 3, hlc_us: 4_000_000, ops: vec![enable(None)] });
    assert_eq!(running(&server).version(), 25);
    let server = Server::on(server.log);
    assert_eq!(running(&server).version(), 25);
}

#[test]
fn a_data_directory_of_format_1_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let (name, path): (MapName, _) = (museum(), dir.path().join(FILE_NAME));
    {
        // The layout of the first version.
        let database = redb::Database::create(&path).unwrap();
        let write = database.begin_write().unwrap();
        let increments: redb::TableDefinition<'_, (&str, u32, u64), &[u8]> = redb::TableDefinition::new("increments");
        let log: redb::TableDefinition<'_, (&str, u64), (u32, u64)> = redb::TableDefinition::new("log");
        for number in 1..=3 {
            let mut bytes = crate::support::bytes(ANA, number);
            bytes[3] = 2;
            let end = bytes.len() - 4;
            let checksum = crc32fast::hash(&bytes[..end]).to_le_bytes();
            bytes[end..].copy_from_slice(&checksum);
            write.open_table(increments).unwrap().insert((name.as_str(), ANA.0, number), bytes.as_slice()).unwrap();
            write.open_table(log).unwrap().insert((name.as_str(), number), (ANA.0, number)).unwrap();
        }
        write.open_table(redb::TableDefinition::<&str, u64>::new("meta")).unwrap().insert("format", 1).unwrap();
        write.commit().unwrap();
    }
    let mut server = Server::on(Arc::new(RedbLog::open(dir.path()).unwrap()));
    assert_eq!(server.state().digest(), crate::support::expected(&[(ANA, 3)]).0.digest());
    server.take_increment(&increment(ANA, 4));
    server.ingest.retain(&name, 0).unwrap().unwrap();
    assert_eq!(server.state().digest(), crate::support::expected(&[(ANA, 4)]).0.digest());
}
