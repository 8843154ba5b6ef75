//! Power failures and disks that take nothing, at any write: a store opens again, has everything
//! that was acknowledged and no half of anything, and goes on by itself.

use crate::support::disk::TestDisk;
use crate::support::{ANA, BEN, node};
use fht_map::MapState;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::ErrorCode;
use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, MapName, NodeKind, Op, VersionVector, encode};
use map_server::catalog::Catalog;
use map_server::config::Limits;
use map_server::ingest::{Arrival, Ingest};
use map_server::store::{IncrementLog, RedbLog};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

const NOW_US: u64 = 1_795_000_000_000_000;

/// Increment `number` of a robot: a node, and an edge to the one before.
fn small(author: AuthorId, number: u64) -> Increment {
    let id = node(author, number as u32);
    let pose = FixedPose::from_metres(number as f64, 0.0, 0.0);
    let mut ops = vec![Op::PutNode { id, kind: NodeKind::Support, pose }];
    if number > 1 {
        ops.push(Op::PutEdge { edge: EdgeKey::new(node(author, number as u32 - 1), id) });
    }
    Increment { author, number, hlc_us: 1_000_000 + number, ops }
}

/// A server's writer over a disk.
struct Bench {
    log: Arc<RedbLog>,
    catalog: Arc<Catalog>,
    ingest: Ingest,
}

impl Bench {
    fn open(disk: &TestDisk, seed: u64) -> Self {
        let log = RedbLog::on_disk(Box::new(disk.clone())).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let log = Arc::new(log);
        let catalog = Catalog::load(log.as_ref()).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let catalog = Arc::new(catalog);
        let ingest = Ingest::new(Arc::clone(&log) as _, Arc::clone(&catalog), Limits::default());
        Self { log, catalog, ingest }
    }

    fn vectors(&self) -> BTreeMap<MapName, VersionVector> {
        self.catalog.heads().iter().map(|head| (head.map.clone(), head.vector.clone())).collect()
    }

    /// Whatever is there is whole: it adds up to what its numbers say.
    fn check(&self, seed: u64) {
        for head in self.catalog.heads() {
            let mut state = MapState::new();
            for (author, last) in head.vector.iter() {
                (1..=last).for_each(|number| state.apply(&small(author, number)));
            }
            assert_eq!(state.digest(), head.digest, "seed {seed}: map {} at {}", head.map, head.vector);
        }
    }

    /// Writes something: what the vectors are if all of it is stored, and whether it was.
    fn write(&mut self, rng: &mut ChaCha8Rng) -> (BTreeMap<MapName, VersionVector>, bool) {
        let mut after = self.vectors();
        let names: Vec<MapName> = ["museum", "attic"].iter().map(|name| name.parse().unwrap()).collect();
        let map = &names[usize::from(rng.random_bool(0.2))];
        if rng.random_bool(0.15) && after.contains_key(map) {
            let keep = rng.random_range(0..20);
            return (after, self.ingest.retain(map, keep).is_ok());
        }
        let mut arrivals = Vec::new();
        for _ in 0..rng.random_range(1..=3) {
            let author = if rng.random_bool(0.5) { ANA } else { BEN };
            let vector = after.entry(map.clone()).or_default();
            for number in vector.get(author) + 1..=vector.get(author) + rng.random_range(1..=8_u64) {
                let key = Key::increment(map, author, number).to_string();
                arrivals.push(Arrival { key, payload: Ok(encode(&small(author, number)).unwrap()) });
                vector.set(author, number);
            }
        }
        (after, self.ingest.take_arrivals(arrivals, NOW_US).is_ok())
    }
}

#[test]
fn a_power_failure_at_any_write_loses_nothing_acknowledged_and_leaves_nothing_half() {
    const SEEDS: u64 = 60;
    const CRASHES: u64 = 6;
    let (begin, mut cut_off, mut kept) = (Instant::now(), 0, 0);
    for seed in 0..SEEDS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let disk = TestDisk::default();
        let mut bench = Bench::open(&disk, seed);
        for _ in 0..CRASHES {
            for _ in 0..rng.random_range(0..4) {
                assert!(bench.write(&mut rng).1, "seed {seed}: the disk works");
            }
            let acknowledged = bench.vectors();
            disk.fail_after(rng.random_range(0..60));
            let (mut whole, mut is_stored) = bench.write(&mut rng);
            let mut before = acknowledged;
            while is_stored {
                before = whole;
                (whole, is_stored) = bench.write(&mut rng);
            }
            drop(bench);
            disk.lose_power(&mut rng);
            bench = Bench::open(&disk, seed);
            bench.check(seed);
            let found = bench.vectors();
            assert!(
                found == before || found == whole,
                "seed {seed}: {found:?}; acknowledged {before:?}, then {whole:?}"
            );
            cut_off += 1;
            kept += u64::from(found == whole && whole != before);
        }
    }
    println!(
        "{cut_off} power failures in {:.1} s; {kept} times what was not acknowledged was there",
        begin.elapsed().as_secs_f64()
    );
    assert!(kept > 0);
}

#[test]
fn a_disk_that_takes_nothing_for_a_while_stops_nobody_who_reads() {
    const SEEDS: u64 = 150;
    let museum: MapName = "museum".parse().unwrap();
    let mut adopted = 0;
    for seed in 0..SEEDS {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let disk = TestDisk::default();
        let mut bench = Bench::open(&disk, seed);
        while bench.vectors().get(&museum).is_none_or(|vector| vector.version() < 40) {
            assert!(bench.write(&mut rng).1);
        }
        disk.fail_after(rng.random_range(0..60));
        let mut before = bench.vectors();
        let whole = loop {
            let (whole, is_stored) = bench.write(&mut rng);
            if !is_stored {
                break whole;
            }
            before = whole;
        };
        assert!(bench.log.fault().is_some(), "seed {seed}");
        bench.ingest.stand_still();
        // Everything acknowledged is there, can be read from the log, and nothing else is shown.
        assert_eq!(bench.vectors(), before, "seed {seed}");
        bench.check(seed);
        let view = bench.catalog.view(&museum).unwrap();
        let lacking = bench.log.reader().lacking(&museum, &VersionVector::default(), &view.head.vector, usize::MAX);
        let lacking = lacking.unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        assert!(!lacking.increments.is_empty() || !lacking.compacted.is_empty(), "seed {seed}");
        // What comes is refused, to be sent again.
        let next = view.head.vector.get(ANA) + 1;
        let arrival = |number| Arrival {
            key: Key::increment(&museum, ANA, number).to_string(),
            payload: Ok(encode(&small(ANA, number)).unwrap()),
        };
        let outcome = bench.ingest.take_arrivals(vec![arrival(next - 1), arrival(next)], NOW_US).unwrap();
        assert_eq!(outcome.notices.iter().map(|notice| notice.reply.code).collect::<Vec<_>>(), [ErrorCode::ReadOnly]);
        assert!(outcome.announce.contains(&museum) == (next > 1), "seed {seed}: what is stored is acknowledged again");
        assert!(bench.log.try_again().is_err(), "seed {seed}: the disk still fails");
        assert!(bench.log.reader().vector_at(&museum, 1).is_ok(), "seed {seed}: and can be read");

        disk.heal();
        bench.log.try_again().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        bench.ingest.go_on().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let found = bench.vectors();
        assert!(found == before || found == whole, "seed {seed}: {found:?}; {before:?}, {whole:?}");
        adopted += u64::from(found == whole && whole != before);
        bench.check(seed);
        for _ in 0..3 {
            assert!(bench.write(&mut rng).1, "seed {seed}: it goes on");
        }
        let last = bench.vectors();
        drop(bench);
        let bench = Bench::open(&disk, seed);
        assert_eq!(bench.vectors(), last, "seed {seed}");
        bench.check(seed);
    }
    println!("{adopted} of {SEEDS} times the commit that failed was there all the same");
}
