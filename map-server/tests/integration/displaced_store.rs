//! A server whose file is moved, removed, cut off, replaced or changed under it: it acknowledges
//! nothing that would be lost, says what is wrong, goes on answering, and leaves what it finds as
//! it is. It goes on when its store is back.

use crate::support::{
    ANA, BEN, Server, ask, bytes, client, expected, free_endpoint, head, head_when, key, museum, until_up, write_until,
};
use fht_proto::api::reply::MapsReply;
use map_server::store::{CompactedRecord, CompactionFloor, IncrementLog, IncrementOrigin, Record, RedbLog};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use zenoh::Session;

/// Increments that are acknowledged before anything happens.
const BEFORE: u64 = 60;

/// Where a server keeps its maps.
struct Place {
    dir: TempDir,
}

impl Place {
    fn new() -> Self {
        Self { dir: tempfile::tempdir().unwrap() }
    }

    fn beside(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn parent(&self) -> PathBuf {
        self.beside("site")
    }

    fn data(&self) -> PathBuf {
        self.parent().join("data")
    }

    fn file(&self) -> PathBuf {
        self.data().join("maps.redb")
    }

    fn backup(&self) -> PathBuf {
        self.beside("backup")
    }

    /// What lies under the store's name, if anything does.
    fn found(&self) -> Option<Vec<u8>> {
        std::fs::read(self.file()).ok()
    }

    /// Puts the backup in the place of whatever is there, in one step.
    fn put_back(&self) {
        let copy = self.beside("copy");
        std::fs::copy(self.backup(), &copy).unwrap();
        std::fs::rename(copy, self.file()).unwrap();
    }
}

fn health(endpoint: &str) -> String {
    let args = ["health", "--connect", endpoint];
    let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).output().unwrap();
    String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap()
}

async fn why_read_only(session: &Session) -> String {
    let maps: MapsReply = serde_json::from_slice(ask(session, "fht/maps").await[0].as_ref().unwrap()).unwrap();
    maps.read_only.unwrap_or_default()
}

/// The first increments of the map. How many are acknowledged; no more are on their way then.
async fn begin(session: &Session) -> u64 {
    for number in 1..=BEFORE {
        session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
    }
    head_when(session, |head| head.version == BEFORE).await.version
}

/// A server with some increments; its file is harmed, and mended, and the server starts again.
/// `says` is what it says of the harm.
async fn scenario(harm: impl FnOnce(&Place), mend: impl FnOnce(&Place), says: &str) {
    let (place, endpoint) = (Place::new(), free_endpoint());
    let log = place.beside("log");
    let mut server = Server::with(&place.data(), &endpoint, &[], &log);
    let session = client(&endpoint).await;
    until_up(&session).await;
    let acknowledged = begin(&session).await;
    std::fs::copy(place.file(), place.backup()).unwrap();

    harm(&place);
    let found = place.found();
    let now = write_until(&session, 20, |head| head.read_only).await;
    assert_eq!(now.version, acknowledged, "nothing was acknowledged since");
    // It stays so, whatever is tried meanwhile.
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(7) {
        let number = acknowledged + 1;
        session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
        let now = head(&session).await.expect("it answers");
        assert!(now.read_only && now.version == acknowledged, "{now:?}");
        assert!(ask(&session, "fht/museum/path?from=0,0;to=5,0").await.iter().all(Result::is_ok));
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    assert!(place.found() == found, "what was found there is as it was");
    let reason = why_read_only(&session).await;
    let name = place.file().display().to_string();
    assert!(reason.contains(says) && reason.contains(&name), "{reason}");
    let said = health(&endpoint);
    assert!(said.contains("takes nothing in") && said.contains(says), "{said}");
    let said = std::fs::read_to_string(&log).unwrap();
    assert!(said.contains("cannot be written") && said.contains(says) && !said.contains("panicked"), "{said}");

    mend(&place);
    let last = write_until(&session, 20, |head| head.version >= acknowledged + 100 && !head.read_only).await;
    server.kill();
    server = Server::with(&place.data(), &endpoint, &[], &log);
    until_up(&session).await;
    let again = head_when(&session, |head| head.version >= last.version).await;
    let (state, vector) = expected(&[(ANA, again.version)]);
    assert_eq!((again.digest, again.vector), (state.digest(), vector));
    assert_eq!(server.terminate(), Some(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_was_moved() {
    let away = |place: &Place| std::fs::rename(place.file(), place.beside("away")).unwrap();
    let back = |place: &Place| std::fs::rename(place.beside("away"), place.file()).unwrap();
    scenario(away, back, "was moved or removed").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_was_removed() {
    scenario(|place| std::fs::remove_file(place.file()).unwrap(), Place::put_back, "was moved or removed").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_was_truncated() {
    let truncate = |place: &Place| {
        std::fs::File::options().write(true).open(place.file()).unwrap().set_len(4096).unwrap();
    };
    let copy_back = |place: &Place| _ = std::fs::copy(place.backup(), place.file()).unwrap();
    scenario(truncate, copy_back, "was truncated to 4096 of").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_was_replaced_by_another() {
    let replace = |place: &Place| {
        let other = place.beside("other");
        let log = RedbLog::open(&other).unwrap();
        log.append(&records(1, 9)).unwrap();
        drop(log);
        std::fs::rename(other.join("maps.redb"), place.file()).unwrap();
    };
    scenario(replace, Place::put_back, "was replaced by something else").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_was_overwritten() {
    let overwrite = |place: &Place| {
        let length = place.file().metadata().unwrap().len();
        let garbage: Vec<u8> = (0..length).map(|at| (at % 251) as u8).collect();
        let file = std::fs::File::options().write(true).open(place.file()).unwrap();
        std::os::unix::fs::FileExt::write_all_at(&file, &garbage, 0).unwrap();
    };
    scenario(overwrite, Place::put_back, "was changed by something else").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_whose_directory_was_moved() {
    let away = |place: &Place| std::fs::rename(place.parent(), place.beside("elsewhere")).unwrap();
    let back = |place: &Place| std::fs::rename(place.beside("elsewhere"), place.parent()).unwrap();
    scenario(away, back, "was moved or removed").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_is_gone_is_missed_though_nobody_writes() {
    let (place, endpoint) = (Place::new(), free_endpoint());
    let _server = Server::with(&place.data(), &endpoint, &[], &place.beside("log"));
    let session = client(&endpoint).await;
    until_up(&session).await;
    begin(&session).await;
    std::fs::rename(place.file(), place.beside("away")).unwrap();
    head_when(&session, |head| head.read_only).await;
    assert!(!place.file().exists(), "no other store is begun in its place");
    std::fs::rename(place.beside("away"), place.file()).unwrap();
    head_when(&session, |head| !head.read_only).await;
}

fn records(first: u64, last: u64) -> Vec<Record> {
    let record = |sequence| Record {
        map: museum(),
        sequence,
        author: BEN,
        number: sequence,
        bytes: vec![7; 20_000],
        origin: IncrementOrigin::Writer,
    };
    (first..=last).map(record).collect()
}

/// The file grows, shrinks, and its first page changes with every commit, and when it is closed.
#[test]
fn what_the_store_does_itself_is_nobody_elses_doing() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("maps.redb");
    let mut longest = 0;
    for round in 0..4 {
        let log = RedbLog::open(dir.path()).unwrap();
        let has_no_fault = |what: &str| {
            log.look();
            assert_eq!(log.fault(), None, "round {round}: {what}");
        };
        has_no_fault("opened");
        for first in (round * 1000 + 1..round * 1000 + 400).step_by(40) {
            log.append(&records(first, first + 39)).unwrap();
            has_no_fault("grown");
        }
        longest = longest.max(file.metadata().unwrap().len());
        let mut floor = CompactionFloor { version: round * 1000 + 400, ..CompactionFloor::default() };
        floor.vector.set(BEN, floor.version);
        let series = CompactedRecord { author: BEN, first: 1, last: floor.version, bytes: vec![7; 100] };
        log.replace_compacted(&museum(), &floor, &[series]).unwrap();
        for number in round * 1000 + 401..round * 1000 + 420 {
            log.append(&records(number, number)).unwrap();
            has_no_fault("compacted");
        }
    }
    assert!(Path::new(&file).metadata().unwrap().len() < longest, "it has become shorter, too");
}
