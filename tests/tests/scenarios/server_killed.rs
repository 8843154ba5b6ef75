//! The map server dies (SIGKILL) during an exploration and comes back: nothing acknowledged may be
//! lost, the explorer goes on meanwhile, and in the end server, explorer and client have the same
//! map. If the explorer dies, too, its next run delivers what it had made by then.

use crate::programs::{executable, start};
use fht_client::{LiveReplica, ReplicaConfig, ask_head};
use fht_demo::{Process, Role, free_endpoint};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::Series;
use fht_proto::{AuthorId, MapName, decode, encode};
use fht_session::SessionConfig;
use mapper::program::ExploreReport;
use mapper::publish::Spool;
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};
use zenoh::Wait;

const PATIENCE: Duration = Duration::from_secs(30);
/// The server is killed when it has acknowledged this many increments.
const KILL_AT: u64 = 15;
/// It comes back when the explorer has written this many more.
const BACK_AFTER: u64 = 10;

fn start_server(data: &Path, endpoint: &str) -> Process {
    Process::map_server(executable(), data, endpoint, PATIENCE).unwrap()
}

#[test]
fn nothing_acknowledged_is_lost_and_all_agree_in_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let report_file = folder.path().join("explorer.json");
    let endpoint = free_endpoint().unwrap();
    let map: MapName = "museum".parse().unwrap();
    let author = AuthorId::of_robot("explorer");
    let mut server = start_server(&data, &endpoint);

    // A client that keeps listening while the server dies.
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let session =
        runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None))).unwrap();
    let replica = LiveReplica::start(&session, &map, "r", ReplicaConfig::default()).unwrap();

    let report_arg = report_file.to_string_lossy().into_owned();
    let args = [
        "explore",
        "--world",
        "museum",
        "--map",
        "museum",
        "--no-cameras",
        "--rate",
        "20",
        "--progress-json",
        "--connect",
        &endpoint,
        "--report",
        &report_arg,
    ];
    let explorer = start(Role::Mapper, args);
    // Acknowledged and written at the kill; then acknowledged after the restart.
    let mut killed: Option<(u64, u64)> = None;
    let mut written_while_dead = 0;
    let mut is_back = false;
    let ended = explorer.follow(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        let count = |name: &str| line[name].as_u64().unwrap();
        let (written, acknowledged) = (count("written"), count("acknowledged"));
        match killed {
            None if acknowledged >= KILL_AT => {
                server.kill().unwrap();
                killed = Some((acknowledged, written));
            }
            Some((acknowledged_then, written_then)) if !is_back && written >= written_then + BACK_AFTER => {
                written_while_dead = written - written_then;
                server = start_server(&data, &endpoint);
                is_back = true;
                let head = wait_for_head(&session, &map);
                let kept = head.vector.get(author);
                assert!(kept >= acknowledged_then, "{acknowledged_then} were acknowledged, {kept} are left");
            }
            _ => {}
        }
    });
    ended.unwrap();
    assert!(is_back, "the server was killed at {killed:?} and did not come back before the end");
    assert!(written_while_dead >= BACK_AFTER);

    let report: ExploreReport = serde_json::from_str(&std::fs::read_to_string(&report_file).unwrap()).unwrap();
    assert!(report.map.delivered);
    assert!(report.explored_fraction > Some(0.95), "{:?}", report.explored_fraction);
    let head = wait_for_head(&session, &map);
    assert_eq!((head.vector.get(author), head.version), (report.map.written, report.map.version));
    assert_eq!(head.digest, report.map.digest, "server and explorer");
    assert!(replica.wait_for(&head.vector, PATIENCE), "the client has {} of {}", replica.read().vector(), head.vector);
    assert_eq!(replica.read().state().digest(), report.map.digest, "client and explorer");
    drop(replica);
    session.close().wait().unwrap();
}

#[test]
fn what_a_killed_explorer_had_made_is_delivered_by_its_next_run() {
    let folder = tempfile::tempdir().unwrap();
    let [data, spool] = ["data", "spool"].map(|name| folder.path().join(name));
    let endpoint = free_endpoint().unwrap();
    let map: MapName = "museum".parse().unwrap();
    let author = AuthorId::of_robot("explorer");
    let mut server = start_server(&data, &endpoint);
    let explore = |more: &[&str]| {
        let spool = spool.to_str().unwrap();
        let usual = ["explore", "--map", "museum", "--no-cameras", "--connect", &endpoint, "--spool", spool];
        start(Role::Mapper, [&usual[..], more].concat())
    };
    let mut first = explore(&["--rate", "20", "--progress-json"]);
    let mut killed: Option<u64> = None;
    first.listen(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        let written = line["written"].as_u64().unwrap();
        if killed.is_none() && line["acknowledged"].as_u64().unwrap() >= KILL_AT {
            server.kill().unwrap();
            killed = Some(written);
        }
        killed.is_none_or(|then| written < then + BACK_AFTER)
    });
    first.kill().unwrap();
    let left = Spool::open(&spool, &map, author).unwrap().backlog().unwrap();
    // Not everything that was written: what was never put need not be there.
    assert!(!left.encoded.is_empty());

    let _server = start_server(&data, &endpoint);
    let report = explore(&["--json"]).finish(Duration::from_secs(120)).unwrap();
    let report: ExploreReport = serde_json::from_str(&report).unwrap();
    assert!(report.joined.is_some() && report.map.written > left.written(), "{report:?}");
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let session =
        runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None))).unwrap();
    let head = wait_for_head(&session, &map);
    assert_eq!((head.vector.get(author), head.digest), (report.map.written, report.map.digest));
    let since = format!("{}?vector={author}:{}", Key::topic(&map, Topic::Since), left.acknowledged);
    let answers = session.get(since).consolidation(zenoh::query::ConsolidationMode::None).wait().unwrap();
    let pieces = answers.iter().map(|answer| decode::<Series>(&answer.result().unwrap().payload().to_bytes()).unwrap());
    let stored: Vec<Vec<u8>> =
        pieces.flat_map(|piece| piece.increments).map(|increment| encode(&increment).unwrap()).collect();
    let made: Vec<Vec<u8>> = left.encoded.into_values().collect();
    assert_eq!(stored[..made.len()], made, "the server has another run's under these numbers");
    session.close().wait().unwrap();
}

/// The head, asked for until the session has found the server again.
fn wait_for_head(session: &zenoh::Session, map: &MapName) -> fht_proto::api::reply::Head {
    let deadline = Instant::now() + PATIENCE;
    loop {
        match ask_head(session, map, Duration::from_secs(2)) {
            Ok(head) => return head,
            Err(error) => assert!(Instant::now() < deadline, "no head: {error}"),
        }
        std::thread::sleep(Duration::from_millis(200));
    }
}
