#![no_main]
//! Damaged stores: `check` and `rescue` end, and what they bring back is what was stored. Six bytes
//! are a change to the file: where, and what stands there then; what is left over cuts it off.

use fht_map::MapState;
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, decode, encode};
use libfuzzer_sys::fuzz_target;
use map_server::catalog::Catalog;
use map_server::config::Limits;
use map_server::ingest::{Arrival, Ingest};
use map_server::rescue::{check, rescue};
use map_server::store::{FILE_NAME, IncrementLog, LogReader, Piece, RedbLog};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, OnceLock};

const NOW_US: u64 = 1_795_000_000_000_000;
type Increments = BTreeMap<(String, AuthorId, u64), Vec<u8>>;

/// A store with two maps of two authors, one compacted in part, and what was put into it.
fn store() -> &'static (Vec<u8>, Increments) {
    static MADE: OnceLock<(Vec<u8>, Increments)> = OnceLock::new();
    MADE.get_or_init(|| {
        let dir = tempfile::tempdir().expect("a folder");
        let mut put = Increments::new();
        {
            let log = Arc::new(RedbLog::open(dir.path()).expect("a new store"));
            let catalog = Arc::new(Catalog::load(log.as_ref()).expect("it is empty"));
            let mut ingest = Ingest::new(log, catalog, Limits::default());
            for (map, name, count) in [("museum", "ana", 60), ("museum", "ben", 20), ("cellar", "ben", 40)] {
                let author = AuthorId::of_robot(name);
                for number in 1..=count {
                    let id = NodeId { author, number: number as u32 };
                    let pose = FixedPose::from_metres(number as f64, 0.0, 0.0);
                    let ops = vec![Op::PutNode { id, kind: NodeKind::Support, pose }];
                    let bytes = encode(&Increment { author, number, hlc_us: number, ops }).expect("it is short");
                    let arrival = Arrival { key: format!("fht/{map}/inc/{author}/{number}"), payload: Ok(bytes.clone()) };
                    ingest.take_arrivals(vec![arrival], NOW_US).expect("a disk");
                    put.insert((map.to_owned(), author, number), bytes);
                }
            }
            let cellar: MapName = "cellar".parse().expect("it is a name");
            ingest.retain(&cellar, 10).expect("a disk");
        }
        (std::fs::read(dir.path().join(FILE_NAME)).expect("the file"), put)
    })
}

fn damaged(bytes: &[u8]) -> Vec<u8> {
    let mut file = store().0.clone();
    let changes = bytes.chunks_exact(6);
    let rest = changes.remainder();
    for change in changes {
        let &[a, b, c, d, value, run] = change else { continue };
        let at = u32::from_le_bytes([a, b, c, d]) as usize % file.len();
        let end = (at + usize::from(run) + 1).min(file.len());
        file[at..end].fill(value);
    }
    if let &[a, b, c, ..] = rest {
        let keep = u32::from_le_bytes([a, b, c, 0]) as usize % file.len();
        file.truncate(keep);
    }
    file
}

/// Every increment that was rescued is one that was stored.
fn compare(dir: &Path) {
    let log = RedbLog::open(dir).expect("what was rescued opens");
    let put = &store().1;
    let each = &mut |map: &str, author, number, piece: Piece<'_>| {
        if let Piece::Increment(bytes) = piece {
            let known = put.get(&(map.to_owned(), author, number));
            assert!(known.is_some_and(|known| known == bytes), "{map} {author} {number} was never stored");
            let increment: Increment = decode(bytes).expect("it reads");
            MapState::new().apply(&increment);
        }
        Ok(())
    };
    log.reader().for_each(None, each).expect("and reads");
    Catalog::load(&log).expect("a server starts with it");
}

fuzz_target!(|bytes: &[u8]| {
    let dir = tempfile::tempdir().expect("a folder");
    let source = dir.path().join("source");
    std::fs::create_dir(&source).expect("a folder");
    std::fs::write(source.join(FILE_NAME), damaged(bytes)).expect("a disk");
    let _ = check(&source, &dir.path().join("scratch"), &|_| ());
    let target = dir.path().join("target");
    if rescue(&source, &target, &|_| ()).is_ok() {
        compare(&target);
    }
});
