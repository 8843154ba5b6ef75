#![no_main]
//! What writers, listed and not, get into a server that guards its room. Four bytes are an
//! increment: who writes it, to which map, how many nodes, and how much later.

use fht_map::{WriterRole, WriterRoles};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, encode};
use libfuzzer_sys::fuzz_target;
use map_server::catalog::Catalog;
use map_server::config::{Limits, Quotas};
use map_server::ingest::{Arrival, Ingest};
use map_server::store::{IncrementLog, MemoryLog};
use std::collections::BTreeMap;
use std::sync::Arc;

const WRITERS: [(WriterRole, &str); 4] = [
    (WriterRole::Explorer, "ana"),
    (WriterRole::Explorer, "ben"),
    (WriterRole::Client, "tug"),
    (WriterRole::Operator, "desk"),
];
const STRANGER: &str = "stranger";
const BEGIN_US: u64 = 1_795_000_000_000_000;

fn limits() -> Limits {
    Limits {
        max_map_bytes: 4000,
        max_total_bytes: 10_000,
        max_map_elements: 60,
        max_total_elements: 150,
        max_maps: 5,
        ..Limits::default()
    }
}

/// Number `count` of its author: as many nodes, or somebody else's taken away.
fn increment(name: &str, number: u64, nodes: u8) -> Increment {
    let author = AuthorId::of_robot(name);
    let first = number as u32 * 16;
    let op = |at: u32| match nodes & 0x80 {
        0 => Op::PutNode { id: NodeId { author, number: first + at }, kind: NodeKind::Support, pose: FixedPose::default() },
        _ => Op::RemoveNode { id: NodeId { author: AuthorId::of_robot("ana"), number: 16 + at } },
    };
    Increment { author, number, hlc_us: BEGIN_US + number, ops: (0..u32::from(nodes & 15) + 1).map(op).collect() }
}

/// Bytes that are stored of each author in each map.
fn stored(log: &MemoryLog) -> BTreeMap<(String, AuthorId), u64> {
    let mut stored = BTreeMap::new();
    let add = &mut |map: &str, author, _, piece: map_server::store::Piece<'_>| {
        *stored.entry((map.to_owned(), author)).or_default() += piece.bytes().len() as u64;
        Ok(())
    };
    log.reader().for_each(None, add).expect("memory can be read");
    stored
}

fn check(log: &MemoryLog, catalog: &Catalog, limits: &Limits, quotas: &Quotas) {
    let stored = stored(log);
    let of = |name: &str| AuthorId::of_robot(name);
    for name in [STRANGER, "tug"] {
        assert!(stored.keys().all(|(_, author)| *author != of(name)), "{name} writes nothing");
    }
    let share = |limit: u64, share: f64| (limit as f64 * share) as u64;
    for name in ["ana", "ben"] {
        let own = || stored.iter().filter(|((_, author), _)| *author == of(name));
        assert!(own().all(|(_, bytes)| *bytes <= share(limits.max_map_bytes, quotas.explorers.map_share)));
        let all: u64 = own().map(|(_, bytes)| bytes).sum();
        assert!(all <= share(limits.max_total_bytes, quotas.explorers.total_share), "{name} has {all}");
        // A map that it alone has written to, it has begun. In others' maps it may write besides.
        let writers = |map: &String| stored.keys().filter(|(other, _)| other == map).count();
        let begun = own().filter(|((map, _), _)| writers(map) == 1).count() as u64;
        assert!(begun <= share(limits.max_maps as u64, quotas.explorers.total_share), "{name} began {begun}");
    }
    assert!(stored.values().sum::<u64>() <= limits.max_total_bytes);
    let elements: usize = catalog.views().iter().map(|view| view.state.elements()).sum();
    assert!(elements <= limits.max_total_elements);
}

fuzz_target!(|bytes: &[u8]| {
    let (limits, quotas) = (limits(), Quotas::default());
    let roles: WriterRoles = WRITERS.into_iter().collect();
    let log = Arc::new(MemoryLog::new());
    let begin = |now: &Arc<MemoryLog>| {
        let catalog = Arc::new(Catalog::load(now.as_ref()).expect("what was stored can be loaded"));
        let ingest = Ingest::new(Arc::clone(now) as Arc<dyn IncrementLog>, Arc::clone(&catalog), limits.clone());
        (ingest.guarded_by(roles.clone(), quotas.clone()).expect("and counted"), catalog)
    };
    let (mut ingest, mut catalog) = begin(&log);
    let mut now_us = BEGIN_US;
    for (at, command) in bytes.chunks_exact(4).take(200).enumerate() {
        let &[who, map, nodes, later] = command else { continue };
        now_us += u64::from(later) * 10_000;
        let name = WRITERS.get(usize::from(who % 5)).map_or(STRANGER, |(_, name)| name);
        let map_name: MapName = format!("map-{}", map % 8).parse().expect("it is a name");
        let written = catalog.view(&map_name).map_or(0, |view| view.head.vector.get(AuthorId::of_robot(name)));
        // Sometimes again, sometimes one that leaves a gap.
        let number = match who >> 6 {
            0 => written.max(1),
            1 => written + 2,
            _ => written + 1,
        };
        let increment = increment(name, number, nodes);
        let key = format!("fht/{map_name}/inc/{}/{number}", increment.author);
        let payload = Ok(encode(&increment).expect("it is short"));
        ingest.take_arrivals(vec![Arrival { key, payload }], now_us).expect("memory takes it");
        if at % 16 == 15 {
            check(&log, &catalog, &limits, &quotas);
        }
        if later == 255 {
            // A restart counts as the server did that ran.
            let digests = |catalog: &Catalog| catalog.heads().iter().map(|head| head.digest).collect::<Vec<_>>();
            let before = digests(&catalog);
            (ingest, catalog) = begin(&log);
            assert_eq!(digests(&catalog), before);
        }
    }
    check(&log, &catalog, &limits, &quotas);
});
