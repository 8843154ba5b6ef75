//! A damaged store: no panic and no hang, whatever bytes of its file are flipped or cut off; what
//! still reads can be rescued, and nothing else is.

use crate::support::site::Site;
use crate::support::{ANA, BEN, Server, increment, museum, node, refused_start, until_up};
use fht_proto::api::reply::ErrorCode;
use fht_proto::api::request::parse;
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeKind, Op, VersionVector, decode, encode};
use map_server::catalog::Catalog;
use map_server::config::Limits;
use map_server::ingest::{Arrival, Ingest};
use map_server::query::{AnswerSources, answer};
use map_server::rescue::{Rescued, check, rescue};
use map_server::store::{
    CompactedRecord, CompactionFloor, FILE_NAME, IncrementLog, LogReader, MemoryLog, Piece, Record, RedbLog,
    StoreError, Stored, Visit,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const SEEDS: u64 = 50;
/// A process that another test begins has this one's locks for a moment.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
const NOW_US: u64 = 1_795_000_000_000_000;

/// Whoever ends the program has no copy to remove.
#[test]
fn a_repair_that_is_interrupted_leaves_nothing() {
    let _alone = ONE_AT_A_TIME.lock();
    let dir = tempfile::tempdir().unwrap();
    let (source, scratch, target) = (dir.path().join("source"), dir.path().join("scratch"), dir.path().join("target"));
    fill(&source);
    std::fs::create_dir(&scratch).unwrap();
    // Of a damaged store more has to be done.
    let mut bytes = std::fs::read(source.join(FILE_NAME)).unwrap();
    damage(&mut bytes, 2);
    std::fs::write(source.join(FILE_NAME), &bytes).unwrap();
    let (mut interrupted, mut wait_ms) = (0, 0.0);
    for round in 0..40 {
        let mut command = Command::new(env!("CARGO_BIN_EXE_map-server"));
        match round % 2 {
            0 => command.arg("check").arg(&source),
            _ => command.arg("rescue").arg(&source).arg(&target),
        };
        command.env("TMPDIR", &scratch).stdout(Stdio::null()).stderr(Stdio::piped());
        let begun = Instant::now();
        let mut child = command.spawn().unwrap();
        while begun.elapsed().as_secs_f64() * 1e3 < wait_ms {
            std::hint::spin_loop();
        }
        let is_over = child.try_wait().unwrap().is_some();
        Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let of_scratch: Vec<_> = std::fs::read_dir(&scratch).unwrap().collect();
        assert!(of_scratch.is_empty(), "after {wait_ms} ms: {of_scratch:?} {said}");
        assert!(!target.join("examined").exists(), "after {wait_ms} ms: {said}");
        // Whoever has an answer already may still give it.
        let is_told = |word: &str| said.contains(word);
        if is_told("interrupted while") && output.status.code() == Some(143) {
            assert!(!is_told("damaged") && !is_told("lost"), "{said}");
            assert!(!target.exists() || target.join(FILE_NAME).exists(), "after {wait_ms} ms: {said}");
            interrupted += 1;
        }
        // So that every part of the work is met.
        wait_ms = if is_over { 0.0 } else { wait_ms + 1.5 };
        let _ = std::fs::remove_dir_all(&target); // if it was finished
    }
    assert!(interrupted > 5, "{interrupted}");
}

/// A map of two authors, a small one beside it, and one of which old increments were compacted.
fn fill(dir: &Path) {
    let log = Arc::new(RedbLog::open(dir).unwrap());
    let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
    let mut ingest = Ingest::new(log, Arc::clone(&catalog), Limits::default());
    let mut take = |map: &str, increments: Vec<Increment>| {
        let arrival = |increment: &Increment| Arrival {
            key: format!("fht/{map}/inc/{}/{}", increment.author, increment.number),
            payload: Ok(encode(increment).unwrap()),
        };
        for batch in increments.chunks(20) {
            ingest.take_arrivals(batch.iter().map(arrival).collect(), NOW_US).unwrap();
        }
    };
    take("museum", (1..=250).map(|number| increment(ANA, number)).collect());
    take("museum", (1..=60).map(|number| increment(BEN, number)).collect());
    let pose = FixedPose::from_metres(1.0, 1.0, 0.0);
    let put = Op::PutNode { id: node(ANA, 0), kind: NodeKind::Support, pose };
    take("attic", vec![Increment { author: ANA, number: 1, hlc_us: 1, ops: vec![put] }]);
    take("cellar", (1..=90).map(|number| increment(BEN, number)).collect());
    ingest.retain(&"cellar".parse().unwrap(), 30).unwrap();
}

#[test]
fn an_empty_file_one_of_something_else_and_the_beginning_of_one_are_damaged() {
    let whole = tempfile::tempdir().unwrap();
    fill(whole.path());
    let beginning = std::fs::read(whole.path().join(FILE_NAME)).unwrap()[..100].to_vec();
    for bytes in [Vec::new(), vec![7; 5000], beginning] {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join(FILE_NAME), &bytes).unwrap();
        let error = RedbLog::open(dir.path()).err().unwrap();
        assert_eq!(matches!(error, StoreError::Empty { .. }), bytes.is_empty(), "{error}");
        assert_eq!(matches!(error, StoreError::Broken { .. }), !bytes.is_empty(), "{error}");
        let (code, said) = refused_start(dir.path(), &crate::support::free_endpoint());
        assert!(code == Some(1) && said.contains("backup"), "{said}");
        assert!(bytes.is_empty() == said.contains("move the file away"), "{said}");
        let scratch = dir.path().join("scratch");
        let damage = check(dir.path(), &scratch, &|_| ()).unwrap().damage.unwrap();
        assert!(!damage.contains("scratch"), "{damage}");
        // Where nothing was found there is no store that somebody would take for one.
        for _ in 0..2 {
            assert!(rescue(dir.path(), &scratch, &|_| ()).unwrap().authors.is_empty());
            assert!(!scratch.join(FILE_NAME).exists());
        }
    }
}

#[test]
fn a_store_in_use_is_not_examined() {
    let dir = tempfile::tempdir().unwrap();
    let log = RedbLog::open(dir.path()).unwrap();
    let error = check(dir.path(), &dir.path().join("scratch"), &|_| ()).err().unwrap().to_string();
    assert!(error.contains("in use"), "{error}");
    drop(log);
    // A process that another test begins at this moment has the file for an instant, too.
    let begin = Instant::now();
    let report = loop {
        match check(dir.path(), &dir.path().join("scratch"), &|_| ()) {
            Err(error) if error.to_string().contains("in use") && begin.elapsed() < Duration::from_secs(10) => {
                std::thread::sleep(Duration::from_millis(10));
            }
            outcome => break outcome.unwrap(),
        }
    };
    assert!(report.damage.is_none());
}

/// All operations that a store holds, by map, author, number and place, as text.
fn contents(dir: &Path) -> BTreeMap<(String, AuthorId, u64, u16), String> {
    let log = RedbLog::open(dir).unwrap();
    let mut all = BTreeMap::new();
    let visit = &mut |map: &str, author: AuthorId, _: u64, piece: Piece<'_>| {
        match piece {
            Piece::Increment(bytes) => {
                let increment: Increment = decode(bytes).unwrap();
                for (op, index) in increment.ops.iter().zip(0..) {
                    all.insert((map.to_owned(), author, increment.number, index), format!("{op:?}"));
                }
            }
            Piece::Compacted(bytes) => {
                let series: fht_proto::CompactedSeries = decode(bytes).unwrap();
                for rest in &series.rests {
                    for (index, op) in &rest.ops {
                        all.insert((map.to_owned(), author, rest.number, *index), format!("{op:?}"));
                    }
                }
            }
        }
        Ok(())
    };
    log.reader().for_each(None, visit).unwrap();
    all
}

fn vectors(dir: &Path) -> BTreeMap<MapName, VersionVector> {
    let catalog = Catalog::load(&RedbLog::open(dir).unwrap()).unwrap();
    catalog.heads().iter().map(|head| (head.map.clone(), head.vector.clone())).collect()
}

fn damage(bytes: &mut Vec<u8>, seed: u64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    if seed % 5 == 4 {
        let length = rng.random_range(0..bytes.len());
        bytes.truncate(length);
        return format!("cut off at {length}");
    }
    let flips = [1, 20, 200, 2000][(seed % 5) as usize];
    for _ in 0..flips {
        let at = rng.random_range(0..bytes.len());
        bytes[at] ^= rng.random_range(1..=255_u8);
    }
    format!("{flips} bytes flipped")
}

#[test]
fn a_store_in_which_damage_was_found_is_left_as_it_is() {
    let whole = tempfile::tempdir().unwrap();
    fill(whole.path());
    let whole = std::fs::read(whole.path().join(FILE_NAME)).unwrap();
    let mut left = 0;
    for seed in (0..200).filter(|seed| seed % 5 != 4) {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join(FILE_NAME);
        let mut bytes = whole.clone();
        let how = damage(&mut bytes, seed);
        std::fs::write(&file, bytes).unwrap();
        let Ok(log) = RedbLog::open(dir.path()) else { continue };
        let opened = std::fs::read(&file).unwrap();
        if Catalog::load(&log).is_err() {
            // The storage library would write once more, and sometimes end the process.
            drop(log);
            assert!(std::fs::read(&file).unwrap() == opened, "seed {seed}: {how}");
            assert!(!matches!(RedbLog::open(dir.path()), Err(StoreError::InUse { .. })), "seed {seed}: {how}");
            left += 1;
        }
    }
    assert!(left > 20, "{left}");
}

#[test]
fn what_still_reads_of_a_damaged_store_is_rescued_and_nothing_else() {
    let _alone = ONE_AT_A_TIME.lock();
    let dir = tempfile::tempdir().unwrap();
    let source = dir.path().join("source");
    fill(&source);
    let whole = std::fs::read(source.join(FILE_NAME)).unwrap();
    let (all, before) = (contents(&source), vectors(&source));
    // Undamaged.
    let target = dir.path().join("copy");
    let rescued = rescue(&source, &target, &|_| ()).unwrap();
    assert_eq!((&rescued.damage, vectors(&target) == before, contents(&target) == all), (&None, true, true));
    assert!(rescue(&source, &target, &|_| ()).is_err(), "a store is not written over");

    let (mut loaded, mut kept) = (0, 0);
    for seed in 0..SEEDS {
        let mut bytes = whole.clone();
        let what = damage(&mut bytes, seed);
        let damaged = dir.path().join(format!("damaged-{seed}"));
        std::fs::create_dir(&damaged).unwrap();
        std::fs::write(damaged.join(FILE_NAME), &bytes).unwrap();
        let begin = Instant::now();
        let target = dir.path().join(format!("rescued-{seed}"));
        let rescued = rescue(&damaged, &target, &|_| ()).unwrap_or_else(|error| panic!("seed {seed}, {what}: {error}"));
        assert!(std::fs::read(damaged.join(FILE_NAME)).unwrap() == bytes, "seed {seed}: the source has changed");
        let (found, after) = (contents(&target), vectors(&target));
        for (place, op) in &found {
            assert_eq!(all.get(place), Some(op), "seed {seed}, {what}: {place:?} is invented");
        }
        for (map, vector) in &after {
            assert!(before.get(map).is_some_and(|before| before.covers(vector)), "seed {seed}, {what}: {map} {vector}");
        }
        let lost: u64 = rescued.authors.iter().map(|author| author.lost).sum();
        println!(
            "seed {seed}, {what}: {} of {} operations, {lost} increments known to be lost, {:.2} s, {}",
            found.len(),
            all.len(),
            begin.elapsed().as_secs_f64(),
            rescued.damage.as_deref().unwrap_or("whole")
        );
        kept += found.len();
        // As a server opens it, and reads all of it.
        let opened = RedbLog::open(&damaged).and_then(|log| Catalog::load_what_reads(&log).map(|_| ()));
        loaded += usize::from(opened.is_ok());
        assert!(begin.elapsed() < Duration::from_secs(60), "seed {seed}, {what}");
    }
    println!("{loaded} of {SEEDS} damaged stores open; {kept} of {} operations rescued", SEEDS as usize * all.len());
    assert!(kept * 10 > all.len() * SEEDS as usize * 4, "{kept}");
}

#[test]
fn the_program_says_what_is_wrong_and_what_can_be_done() {
    let _alone = ONE_AT_A_TIME.lock();
    let dir = tempfile::tempdir().unwrap();
    let source = dir.path().join("source");
    fill(&source);
    let run = |args: &[&str]| {
        let program = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).stdin(Stdio::null()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (program.status.code(), text(program.stdout), text(program.stderr))
    };
    let path = source.to_str().unwrap();
    let (code, said, _) = run(&["check", path]);
    assert!(code == Some(0) && said.contains("the store is whole"), "{said}");

    // 200 bytes are flipped; of such files many do not even open.
    let whole = std::fs::read(source.join(FILE_NAME)).unwrap();
    let mut refused = 0;
    for seed in 0..12 {
        let mut bytes = whole.clone();
        damage(&mut bytes, 5 * seed + 2);
        std::fs::write(source.join(FILE_NAME), &bytes).unwrap();
        let (code, said, complaint) = run(&["check", path, "--json"]);
        let found: Rescued = serde_json::from_str(&said).unwrap_or_else(|error| panic!("{error}: {said}{complaint}"));
        assert_eq!(code, Some(i32::from(found.damage.is_some())), "seed {seed}: {said}{complaint}");
        if found.damage.is_none() {
            continue;
        }
        assert_eq!(check(&source, dir.path(), &|_| ()).unwrap().authors, found.authors);
        let target = dir.path().join(format!("rescued-{seed}"));
        let (code, said, complaint) = run(&["rescue", path, target.to_str().unwrap()]);
        let is_told = said.contains("map museum, author") && complaint.contains("are lost") == (found.lost() > 0);
        assert!(code == Some(i32::from(found.lost() > 0)) && is_told, "seed {seed}: {said}{complaint}");
        if RedbLog::open(&source).and_then(|log| Catalog::load_what_reads(&log).map(|_| ())).is_err() {
            refused += 1;
            let (code, said) = refused_start(&source, &crate::support::free_endpoint());
            assert_eq!(code, Some(1), "seed {seed}: {said}");
            for part in [FILE_NAME, "backup", "map-server restore", "map-server check", "map-server rescue"] {
                assert!(said.contains(part), "seed {seed}: {said}");
            }
            assert!(!said.contains("panicked"), "{said}");
        }
    }
    assert!(refused > 3, "{refused}");
    std::fs::write(source.join(FILE_NAME), [0; 8192]).unwrap();
    let target = dir.path().join("of-nothing");
    let (code, _, said) = run(&["rescue", path, target.to_str().unwrap()]);
    assert!(code == Some(1) && said.contains("nothing of") && !target.exists(), "{said}");
    let (code, _, said) = run(&["rescue", dir.path().join("nowhere").to_str().unwrap(), "x"]);
    assert!(code == Some(2) && said.contains("there is no store"), "{said}");
}

#[test]
fn whichever_page_is_lost_nobody_is_forgotten_and_numbers_go_on() {
    const PAGE: usize = 4096;
    let _alone = ONE_AT_A_TIME.lock();
    let dir = tempfile::tempdir().unwrap();
    let (source, scratch, target) = (dir.path().join("source"), dir.path().join("scratch"), dir.path().join("target"));
    let log = Arc::new(RedbLog::open(&source).unwrap());
    let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
    let mut ingest = Ingest::new(log, catalog, Limits::default());
    let arrival = |author, number| Arrival {
        key: crate::support::key(author, number),
        payload: Ok(crate::support::bytes(author, number)),
    };
    ingest.take_arrivals((1..=20).map(|number| arrival(ANA, number)).collect(), NOW_US).unwrap();
    ingest.take_arrivals((1..=26).map(|number| arrival(BEN, number)).collect(), NOW_US).unwrap();
    ingest.retain(&museum(), 0).unwrap().unwrap();
    ingest.take_arrivals((21..=40).map(|number| arrival(ANA, number)).collect(), NOW_US).unwrap();
    drop(ingest);

    let (before, file) = (vectors(&source), source.join(FILE_NAME));
    let whole = std::fs::read(&file).unwrap();
    for begin in (0..whole.len()).step_by(PAGE) {
        let page = begin..whole.len().min(begin + PAGE);
        if whole[page.clone()].iter().all(|byte| *byte == 0) {
            continue;
        }
        let mut damaged = whole.clone();
        damaged[page].fill(0);
        std::fs::write(&file, &damaged).unwrap();
        let found = check(&source, &scratch, &|_| ()).unwrap();
        let mut ends: BTreeMap<MapName, VersionVector> = BTreeMap::new();
        for author in &found.authors {
            ends.entry(author.map.clone()).or_default().set(author.author, author.last);
        }
        assert_eq!(ends, before, "without the page at {begin}: {found:?}");
    }

    // Every page in which a message begins.
    let mut damaged = whole.clone();
    for (begin, _) in whole.windows(3).enumerate().filter(|(_, part)| part.starts_with(b"FHT")) {
        let page = begin / PAGE * PAGE;
        damaged[page..whole.len().min(page + PAGE)].fill(0);
    }
    std::fs::write(&file, &damaged).unwrap();
    let rescued = rescue(&source, &target, &|_| ()).unwrap();
    assert!(rescued.authors.iter().all(|author| author.lost == author.last), "{rescued:?}");
    assert_eq!((rescued.lost(), rescued.unknown_ends().count()), (66, 0));
    assert_eq!(vectors(&target), before);
}

/// It may have been enabled before: robots would drive on less than its maker saw.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_release_of_which_a_part_is_lost_cannot_be_had() {
    const PAGE: usize = 4096;
    let mut site = Site::with(40).await;
    site.run(&["release", "create", "museum", "whole"]);
    assert_eq!(site.run(&["release", "list", "museum"])["releases"][0]["available"], true);
    assert_eq!(site.server.terminate(), Some(0));
    let (source, target) = (site.dir.path().join("data"), site.dir.path().join("rescued"));
    let whole = std::fs::read(source.join(FILE_NAME)).unwrap();
    // One page with increments, so that the release itself is still known.
    let pages: BTreeSet<usize> =
        whole.windows(3).enumerate().filter(|(_, part)| part.starts_with(b"FHT")).map(|(at, _)| at / PAGE).collect();
    let lost_one = pages.into_iter().find(|page| {
        let mut damaged = whole.clone();
        damaged[page * PAGE..(page + 1) * PAGE].fill(0);
        std::fs::write(source.join(FILE_NAME), &damaged).unwrap();
        let found = check(&source, site.dir.path(), &|_| ()).unwrap();
        found.lost() > 0 && found.authors.iter().all(|author| author.author == ANA || author.lost == 0)
    });
    assert!(lost_one.is_some(), "no page has only increments of the robot");
    assert!(rescue(&source, &target, &|_| ()).unwrap().lost() > 0);
    let lost = RedbLog::open(&target).unwrap().lost(&museum()).unwrap();
    let checked = check(&target, site.dir.path(), &|_| ()).unwrap();
    assert!(lost > 0 && checked.damage.is_none() && checked.authors[0].lost_before == lost, "{checked:?}");
    let folded = checked.authors.iter().find(|author| author.author == ANA).map(|author| author.folded);
    assert!(folded.is_some_and(|folded| folded >= lost), "{checked:?}");
    let words = Command::new(env!("CARGO_BIN_EXE_map-server")).arg("check").arg(&target).output().unwrap();
    let words = String::from_utf8(words.stdout).unwrap();
    assert!(words.contains(" are folded") && words.contains("an earlier rescue did not find"), "{words}");
    site.server = Server::start(&target, &site.endpoint);
    until_up(&site.session).await;
    assert_eq!(site.run(&["release", "list", "museum"])["releases"][0]["available"], false);
    let said = site.complaint(&["diff", "museum", "whole", "head"]);
    assert!(said.contains("a part of release whole@") && said.contains("is lost"), "{said}");
}

/// A log that cannot be read any more.
#[derive(Debug, Default)]
struct Worn {
    log: MemoryLog,
    is_unreadable: AtomicBool,
}

impl Worn {
    fn read(&self) -> Result<&dyn LogReader, StoreError> {
        let reason = "page 7 is no page".to_owned();
        let is_unreadable = self.is_unreadable.load(Ordering::Relaxed);
        if is_unreadable { Err(StoreError::Disk { action: "read", reason }) } else { Ok(self.log.reader()) }
    }
}

impl IncrementLog for Worn {
    fn reader(&self) -> &dyn LogReader {
        self
    }
    fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        self.log.append(records)
    }
    fn add_compacted(&self, map: &MapName, to: &CompactionFloor, it: &[CompactedRecord]) -> Result<(), StoreError> {
        self.log.add_compacted(map, to, it)
    }
    fn replace_compacted(&self, map: &MapName, to: &CompactionFloor, it: &[CompactedRecord]) -> Result<(), StoreError> {
        self.log.replace_compacted(map, to, it)
    }
}

impl LogReader for Worn {
    fn stored(&self, map: &MapName, author: AuthorId, number: u64) -> Result<Stored, StoreError> {
        self.read()?.stored(map, author, number)
    }
    fn for_each(&self, of: Option<&MapName>, visit: &mut Visit<'_>) -> Result<(), StoreError> {
        self.read()?.for_each(of, visit)
    }
    fn for_each_lacking(
        &self,
        map: &MapName,
        have: &VersionVector,
        upto: &VersionVector,
        visit: &mut dyn FnMut(Piece<'_>) -> ControlFlow<()>,
    ) -> Result<(), StoreError> {
        self.read()?.for_each_lacking(map, have, upto, visit)
    }
    fn vector_at(&self, map: &MapName, version: u64) -> Result<Option<VersionVector>, StoreError> {
        self.read()?.vector_at(map, version)
    }
    fn floor(&self, map: &MapName) -> Result<CompactionFloor, StoreError> {
        self.read()?.floor(map)
    }
}

#[test]
fn a_server_goes_on_when_its_log_cannot_be_read() {
    let worn = Arc::new(Worn::default());
    let log: Arc<dyn IncrementLog> = worn.clone();
    let catalog = Arc::new(Catalog::load(log.as_ref()).unwrap());
    let mut ingest = Ingest::new(Arc::clone(&log), Arc::clone(&catalog), Limits::default());
    let sources = AnswerSources {
        writers: None,
        catalog: Arc::clone(&catalog),
        log,
        active_rules: Arc::default(),
        fleet: Arc::default(),
        operators: Arc::default(),
        config: Arc::default(),
    };
    let arrival =
        |number| Arrival { key: crate::support::key(ANA, number), payload: Ok(crate::support::bytes(ANA, number)) };
    ingest.take_arrivals((1..=9).map(arrival).collect(), NOW_US).unwrap();
    let ask = |selector: &str| {
        let (key, parameters) = selector.split_once('?').unwrap_or((selector, ""));
        let pairs = parameters.split(';').filter_map(|pair| pair.split_once('='));
        answer(parse(key.parse().unwrap(), pairs, None).unwrap(), &sources, NOW_US)
    };
    assert!(ask("fht/museum/since").is_ok() && ask("fht/museum/diff?from=3").is_ok());

    worn.is_unreadable.store(true, Ordering::Relaxed);
    for unreadable in ["fht/museum/since", "fht/museum/snapshot?version=4", "fht/museum/diff?from=3"] {
        assert_eq!(ask(unreadable).unwrap_err().code, ErrorCode::Internal, "{unreadable}");
    }
    for at_hand in ["fht/museum/head", "fht/museum/path?from=0,0;to=5,0", "fht/museum/nodes?near=0,0"] {
        assert!(ask(at_hand).is_ok(), "{at_hand}");
    }
    assert!(ingest.retain(&museum(), 2).is_err());
    // What was stored before comes again, and more: the head says what there is.
    let outcome = ingest.take_arrivals((8..=12).map(arrival).collect(), NOW_US).unwrap();
    assert!(outcome.announce.contains(&museum()) && outcome.notices.is_empty());
    assert_eq!(catalog.view(&museum()).unwrap().head.version, 12);
}
