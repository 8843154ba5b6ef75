//! A server process whose disk is full, or does not take a longer file: it goes on answering, says
//! what is wrong, survives `kill -9`, and takes everything in by itself when there is room again.

use crate::support::{ANA, ask, bytes, client, expected, free_endpoint, head, head_when, key, until_up, write_until};
use fht_proto::api::reply::{ErrorCode, ErrorReply, MapsReply, Series};
use fht_proto::decode;
use serde_json::Value;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use zenoh::Session;

/// What keeps the store from growing.
enum Shortage {
    /// A file system in memory, 6 MiB large; the rest of it is filled up.
    Full(PathBuf),
    /// Files may not get longer than this, bytes (`ulimit -f`).
    Limit(Option<u64>),
}

impl Shortage {
    /// A small file system, where one can be mounted.
    fn mounted(dir: &Path) -> Option<Self> {
        std::fs::create_dir(dir).unwrap();
        let args = ["-t", "tmpfs", "-o", "size=6m", "tmpfs"];
        let mount = Command::new("mount").args(args).arg(dir).stderr(Stdio::null()).status();
        mount.is_ok_and(|status| status.success()).then(|| Self::Full(dir.to_owned()))
    }

    fn begin(&mut self, data: &Path, server: &Child) {
        match self {
            Self::Full(dir) => {
                let mut ballast = File::create(dir.join("ballast")).unwrap();
                while ballast.write_all(&[7; 4096]).is_ok() {}
            }
            Self::Limit(limit) => {
                let length = data.join("maps.redb").metadata().unwrap().len();
                *limit = Some(length);
                limit_files(server, &length.to_string());
            }
        }
    }

    fn end(&mut self, server: &Child) {
        match self {
            Self::Full(dir) => std::fs::remove_file(dir.join("ballast")).unwrap(),
            Self::Limit(limit) => {
                *limit = None;
                limit_files(server, "unlimited");
            }
        }
    }

    /// A server on the disk as it is.
    fn serve(&self, data: &Path, endpoint: &str, log: &Path) -> Running {
        let script = match self {
            Self::Limit(Some(bytes)) => format!("prlimit --pid $$ --fsize={bytes}:; exec \"$@\""),
            _ => "exec \"$@\"".to_owned(),
        };
        let args = ["-c", &script, "-", env!("CARGO_BIN_EXE_map-server"), "--data", data.to_str().unwrap()];
        let log = File::options().create(true).append(true).open(log).unwrap();
        let mut server = Command::new("bash");
        server.args(args).args(["--listen", endpoint]).env_remove("RUST_LOG").stderr(log);
        Running(server.spawn().unwrap())
    }
}

impl Drop for Shortage {
    fn drop(&mut self) {
        if let Self::Full(dir) = self {
            let _ = Command::new("umount").arg("-l").arg(dir).status();
        }
    }
}

fn limit_files(server: &Child, bytes: &str) {
    let limit = ["--pid", &server.id().to_string(), &format!("--fsize={bytes}:")];
    assert!(Command::new("prlimit").args(limit).status().unwrap().success());
}

/// A server process, killed when dropped.
struct Running(Child);

impl Running {
    fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}

fn run(args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).output().unwrap();
    String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap()
}

/// Readers get what was acknowledged, all of it, and are told that nothing is taken in.
async fn check_readers(session: &Session, acknowledged: u64) {
    let now = head(session).await.expect("the server answers");
    let (state, vector) = expected(&[(ANA, acknowledged)]);
    assert_eq!((now.digest, &now.vector), (state.digest(), &vector), "as it was acknowledged");
    for selector in ["fht/museum/path?from=0,0;to=5,0", "fht/museum/nodes?near=0,0", "fht/museum/diff?from=3"] {
        assert!(ask(session, selector).await.iter().all(Result::is_ok), "{selector}");
    }
    let replies = ask(session, "fht/museum/since?max_bytes=1048576").await;
    let series: Series = decode(replies[0].as_ref().unwrap()).unwrap();
    assert!(series.increments.len() as u64 >= acknowledged.min(100));
}

async fn scenario(mut shortage: Shortage, dir: &Path) {
    let (data, log, endpoint) = (dir.join("data"), dir.with_extension("log"), free_endpoint());
    let mut server = shortage.serve(&data, &endpoint, &log);
    let session = client(&endpoint).await;
    until_up(&session).await;
    let refusals = session.declare_subscriber(format!("fht/museum/refused/{ANA}")).await.unwrap();
    for number in 1..=60 {
        session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
    }
    head_when(&session, |head| head.version == 60 && !head.read_only).await;

    // No room any more: while a writer writes.
    shortage.begin(&data, &server.0);
    let full = write_until(&session, 100, |head| head.read_only).await;
    let acknowledged = full.version;
    session.put(key(ANA, acknowledged + 1), bytes(ANA, acknowledged + 1)).await.unwrap();
    check_readers(&session, acknowledged).await;
    let told = tokio::time::timeout(Duration::from_secs(10), async {
        loop {
            let sample = refusals.recv_async().await.unwrap();
            let reply: ErrorReply = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
            if reply.code == ErrorCode::ReadOnly {
                return reply;
            }
        }
    });
    assert!(told.await.unwrap().message.contains("cannot be written"));
    let maps: MapsReply = serde_json::from_slice(ask(&session, "fht/maps").await[0].as_ref().unwrap()).unwrap();
    assert!(maps.maps[0].read_only && maps.read_only.is_some_and(|reason| !reason.is_empty()));
    let said = run(&["health", "--connect", &endpoint]);
    assert!(said.contains("takes nothing in"), "{said}");
    // Operators are told, too.
    for order in [&["retain", "museum", "--keep", "5"][..], &["delete", "museum", "--reason", "full"]] {
        let said = run(&[order, &["--connect", &endpoint]].concat());
        assert!(said.contains("takes nothing in"), "{order:?}: {said}");
    }

    // Killed, and started again while there is still no room.
    server.kill();
    server = shortage.serve(&data, &endpoint, &log);
    until_up(&session).await;
    check_readers(&session, head(&session).await.unwrap().version).await;
    let again = write_until(&session, 100, |head| head.read_only).await;
    assert!(again.version >= acknowledged, "{} were acknowledged, {} are there", acknowledged, again.version);
    check_readers(&session, again.version).await;

    // Room: it goes on by itself, and everything arrives.
    shortage.end(&server.0);
    let enough = again.version + 200;
    let last = write_until(&session, 100, |head| head.version >= enough && !head.read_only).await;
    check_readers(&session, last.version).await;
    let said: Value = serde_json::from_str(&run(&["health", "--json", "--connect", &endpoint])).unwrap();
    assert_eq!(said.get("read_only"), None);
    let said = std::fs::read_to_string(&log).unwrap();
    assert!(said.contains("the disk cannot be written") && said.contains("can be written again"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_on_a_disk_mounted_for_reading_answers_and_takes_nothing_in() {
    let dir = tempfile::tempdir().unwrap();
    let (disk, log, endpoint) = (dir.path().join("disk"), dir.path().join("log"), free_endpoint());
    let Some(mounted) = Shortage::mounted(&disk) else {
        eprintln!("skipped: nothing can be mounted here");
        return;
    };
    let data = disk.join("data");
    let mut server = mounted.serve(&data, &endpoint, &log);
    let session = client(&endpoint).await;
    until_up(&session).await;
    for number in 1..=60 {
        session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
    }
    head_when(&session, |head| head.version == 60).await;
    server.kill();
    // A copy of a store has no lock file.
    std::fs::remove_file(data.join("lock")).unwrap();
    let remount = Command::new("mount").args(["-o", "remount,ro"]).arg(&disk).status();
    assert!(remount.is_ok_and(|status| status.success()));

    let _server = mounted.serve(&data, &endpoint, &log);
    until_up(&session).await;
    head_when(&session, |head| head.read_only).await;
    check_readers(&session, 60).await;
    session.put(key(ANA, 61), bytes(ANA, 61)).await.unwrap();
    let said = run(&["health", "--connect", &endpoint]);
    assert!(said.contains("takes nothing in") && said.contains("Read-only file system"), "{said}");
    assert_eq!(head(&session).await.unwrap().version, 60);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_disk_stops_writers_for_as_long_as_it_is_full_and_readers_never() {
    let dir = tempfile::tempdir().unwrap();
    let disk = dir.path().join("disk");
    match Shortage::mounted(&disk) {
        Some(shortage) => scenario(shortage, &disk).await,
        None => eprintln!("skipped: nothing can be mounted here; the test of a limit shows the same"),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_that_may_not_grow_stops_writers_for_as_long_and_readers_never() {
    let dir = tempfile::tempdir().unwrap();
    let disk = dir.path().join("disk");
    std::fs::create_dir(&disk).unwrap();
    scenario(Shortage::Limit(None), &disk).await;
}
