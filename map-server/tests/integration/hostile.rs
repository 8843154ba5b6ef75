//! Increments that passed access control but are wrong: they change nothing, and are counted.
//! (Other authors' numbers, damage in every byte, sizes, deletions and future stamps: `ingest.rs`.)

use crate::support::{ANA, BEN, bytes, increment, key, museum, node, signature};
use fht_map::NodeRouteConfig;
use fht_map::plan::node_route;
use fht_proto::api::reply::{ErrorCode, Head};
use fht_proto::{EdgeKey, FixedPoint, FixedPose, Increment, NodeKind, Op, decode, encode};
use map_server::catalog::Catalog;
use map_server::config::Limits;
use map_server::ingest::{Arrival, BatchOutcome, Ingest, Refusal, check};
use map_server::store::RedbLog;
use std::sync::Arc;

const NOW_US: u64 = 1_795_000_000_000_000;

struct Bench {
    catalog: Arc<Catalog>,
    ingest: Ingest,
    _dir: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let store = Arc::new(RedbLog::open(dir.path()).unwrap());
        let catalog = Arc::new(Catalog::load(store.as_ref()).unwrap());
        let ingest = Ingest::new(store, Arc::clone(&catalog), Limits::default());
        Self { catalog, ingest, _dir: dir }
    }

    fn take_arrivals(&mut self, number: u64, payload: Vec<u8>) -> BatchOutcome {
        self.ingest.take_arrivals(vec![Arrival { key: key(ANA, number), payload: Ok(payload) }], NOW_US).unwrap()
    }

    fn head(&self) -> Head {
        self.catalog.view(&museum()).unwrap().head.as_ref().clone()
    }
}

/// `payload` with the first occurrence of `old` in its body replaced by `new`, and a valid
/// checksum.
fn forge(payload: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let body = &payload[..payload.len() - 4];
    let at = body.windows(old.len()).position(|part| part == old).unwrap();
    let mut forged = [&body[..at], new, &body[at + old.len()..]].concat();
    forged.extend(crc32fast::hash(&forged).to_le_bytes());
    forged
}

#[test]
fn numbers_that_are_none_change_nothing() {
    let mut bench = Bench::new();
    bench.take_arrivals(1, bytes(ANA, 1));
    let before = bench.head();
    let mut scanned = signature(3);
    (scanned.scan.angle_min, scanned.scan.angle_increment) = (-1.234_567, 0.012_345_6);
    let scale = scanned.descriptor.as_ref().unwrap().scale;
    let fields = [scanned.scan.angle_min, scanned.scan.angle_increment, scale];
    let ops = vec![Op::SetSignature { id: node(ANA, 0), signature: scanned }];
    let good = encode(&Increment { ops, ..increment(ANA, 2) }).unwrap();
    let mut refused = 0;
    for field in fields {
        for none in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            if field == scale && none == f32::MAX {
                continue; // a number, if a large one
            }
            let forged = forge(&good, &field.to_le_bytes(), &none.to_le_bytes());
            let told = bench.take_arrivals(2, forged.clone());
            assert!(
                matches!(decode::<Increment>(&forged), Err(fht_proto::CodecError::Invalid(_))),
                "{field} as {none}"
            );
            assert!(told.announce.is_empty());
            refused += 1;
        }
    }
    assert_eq!(Head { refused: 0, ..bench.head() }, before);
    assert_eq!(bench.head().refused, refused);
    bench.take_arrivals(2, good);
    assert_eq!(bench.head().version, 2, "the true one still goes in");
}

#[test]
fn an_edge_to_nowhere_is_stored_and_not_shown() {
    let mut bench = Bench::new();
    bench.take_arrivals(1, bytes(ANA, 1));
    bench.take_arrivals(2, bytes(ANA, 2));
    let before = bench.head();
    // Legal: another robot's node may still be on its way.
    let to_nowhere = [node(BEN, 7), node(ANA, 4_000_000_000), node(BEN, u32::MAX)];
    let ops = to_nowhere.map(|end| Op::PutEdge { edge: EdgeKey::new(node(ANA, 0), end) }).to_vec();
    bench.take_arrivals(3, encode(&Increment { ops, ..increment(ANA, 3) }).unwrap());
    let after = bench.head();
    assert_eq!((after.version, after.edges, after.refused), (3, before.edges, 0));
    let view = bench.catalog.view(&museum()).unwrap();
    assert!(view.state.neighbours(node(ANA, 0)).all(|end| end.id == node(ANA, 1)));
    let at = |x| FixedPoint::from_metres(x, 0.0);
    assert!(node_route::plan(view.state.as_ref(), at(0.0), at(1.0), &NodeRouteConfig::default()).is_ok());
    assert!(view.state.node(node(BEN, 7)).is_none());
}

#[test]
fn ten_million_nodes_stop_at_the_limit() {
    let mut bench = Bench::new();
    bench.take_arrivals(1, bytes(ANA, 1));
    // Claims more, in a few bytes: one more operation than there are, or ten million.
    let ops = vec![Op::RemoveNode { id: node(ANA, 1) }; 3];
    let few = encode(&Increment { ops, hlc_us: 0x1234, ..increment(ANA, 2) }).unwrap();
    let clock = [0xb4, 0x24];
    for count in [&[4][..], &[0x80, 0xad, 0xe2, 0x04], &[0xff, 0xff, 0xff, 0xff, 0x0f]] {
        let told = bench.take_arrivals(2, forge(&few, &[&clock[..], &[3]].concat(), &[&clock[..], count].concat()));
        assert!(told.announce.is_empty());
    }
    assert_eq!((bench.head().version, bench.head().refused), (1, 3));
    // And really has more.
    let limit = Limits::default().max_map_elements;
    let each = Increment::MAX_OPS as u64;
    let put = |id| Op::PutNode { id: node(ANA, id), kind: NodeKind::Support, pose: FixedPose::default() };
    let crowd = |number: u64| {
        let first = (number * each) as u32;
        let ops = (first..first + each as u32).map(put).collect();
        let payload = encode(&Increment { ops, ..increment(ANA, number) }).unwrap();
        Arrival { key: key(ANA, number), payload: Ok(payload) }
    };
    let last = 10_000_000 / each + 2;
    let mut codes = Vec::new();
    for first in (2..=last).step_by(256) {
        let taken = bench.ingest.take_arrivals((first..first + 256).map(crowd).collect(), NOW_US).unwrap();
        codes.extend(taken.notices.into_iter().map(|notice| notice.reply.code));
    }
    assert!(!codes.is_empty() && codes.iter().all(|code| *code == ErrorCode::Full), "{codes:?}");
    let stored = (bench.head().version - 1) as usize * each as usize;
    assert!(stored > limit - 2 * each as usize && stored < limit, "{stored}");
    let full = bench.head();
    assert_eq!(full.support_nodes + full.main_nodes, stored + 1);
    bench.take_arrivals(full.version + 1, bytes(ANA, full.version + 1));
    assert_eq!(bench.head().version, full.version + 1, "what is small still goes in");
}

#[test]
fn one_robot_under_another_robots_key_is_told_apart_without_access_control() {
    let forged = Arrival { key: key(ANA, 1), payload: Ok(bytes(BEN, 1)) };
    assert!(matches!(check(forged, &Limits::default()), Err(Refusal::OtherKey { .. })));
}
