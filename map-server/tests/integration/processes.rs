//! The program as a process: `kill -9` during ingest, a second server on the same data, bad
//! directories, SIGTERM.

use crate::support::{
    ANA, Server, bytes, client, expected, free_endpoint, head, head_when, key, refused_start, until_up,
};
use fht_proto::AuthorId;
use map_server::store::RedbLog;
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::qos::CongestionControl;

/// Increments that are put ahead of the acknowledgement.
const WINDOW: u64 = 200;

/// Puts increments from `acknowledged` on and reads heads, until `enough` are acknowledged.
async fn write(session: &Session, author: AuthorId, mut acknowledged: u64, enough: u64) -> u64 {
    while acknowledged < enough {
        for number in acknowledged + 1..=acknowledged + WINDOW {
            let put = session.put(key(author, number), bytes(author, number));
            put.congestion_control(CongestionControl::Block).await.unwrap();
        }
        if let Some(head) = head(session).await {
            acknowledged = acknowledged.max(head.vector.get(author));
        }
    }
    acknowledged
}

/// Its log lies on the disk that is full, as the maps may: it starts and answers all the same.
#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_log_keeps_nobody_from_serving_or_from_failing_in_order() {
    let full = std::path::Path::new("/dev/full");
    let dir = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint();
    let mut server = Server::with(dir.path(), &endpoint, &["-v"], full);
    let session = client(&endpoint).await;
    until_up(&session).await;
    write(&session, ANA, 0, 5).await;
    let wrong = std::process::Command::new(env!("CARGO_BIN_EXE_map-server"))
        .args(["place", "louvre", "dock", "5,0", "--connect", &endpoint])
        .stderr(std::fs::OpenOptions::new().write(true).open(full).unwrap())
        .status();
    assert!(wrong.unwrap().code().is_some_and(|code| [1, 2].contains(&code)), "not a panic");
    assert_eq!(server.terminate(), Some(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn kill_9_in_the_middle_loses_nothing_acknowledged() {
    let dir = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint();
    let mut acknowledged = 0;
    let mut server = Server::start(dir.path(), &endpoint);
    let session = client(&endpoint).await;
    for round in 1..=5_u64 {
        until_up(&session).await;
        let kept = head(&session).await.map_or(0, |head| head.vector.get(ANA));
        assert!(kept >= acknowledged, "round {round}: {acknowledged} were acknowledged, {kept} are there");
        acknowledged = write(&session, ANA, kept, kept + 300).await;
        // Killed while more is on its way to the disk.
        for number in acknowledged + 1..=acknowledged + WINDOW {
            session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
        }
        tokio::time::sleep(Duration::from_millis(3 * round)).await;
        server.kill();
        server = Server::start(dir.path(), &endpoint);
    }
    until_up(&session).await;
    let last = head_when(&session, |head| head.version >= acknowledged).await;
    let (state, vector) = expected(&[(ANA, last.version)]);
    assert_eq!((last.digest, last.vector), (state.digest(), vector));
}

#[test]
fn kill_9_in_the_very_first_start_does_no_harm() {
    for round in 0..40 {
        let dir = tempfile::tempdir().unwrap();
        let mut server = Server::start(dir.path(), &free_endpoint());
        std::thread::sleep(Duration::from_micros(400 * round));
        server.kill();
        if let Err(error) = RedbLog::open(dir.path()) {
            panic!("killed after {} us: {error}", 400 * round);
        }
    }
    // What a power failure may leave of an unfinished file.
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("maps.redb.new"), [0; 8192]).unwrap();
    RedbLog::open(dir.path()).unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn puts_and_subscriptions_survive_a_restart() {
    let dir = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint();
    let mut server = Server::start(dir.path(), &endpoint);
    let session = client(&endpoint).await;
    // Declared only once.
    let heads = session.declare_subscriber("fht/museum/head").await.unwrap();
    until_up(&session).await;
    write(&session, ANA, 0, WINDOW).await;
    assert!(heads.recv_async().await.is_ok());
    server.kill();
    session.put(key(ANA, WINDOW + 1), bytes(ANA, WINDOW + 1)).await.unwrap(); // lost, but no error
    tokio::time::sleep(Duration::from_millis(300)).await;
    let _again = Server::start(dir.path(), &endpoint);
    until_up(&session).await;
    while heads.try_recv().unwrap().is_some() {}
    write(&session, ANA, WINDOW, 2 * WINDOW).await;
    let heard = tokio::time::timeout(Duration::from_secs(10), heads.recv_async()).await;
    assert!(heard.is_ok(), "the subscription is there again");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn told_to_say_more_it_names_maps_and_robots() {
    let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
    let log = dir.path().join("log");
    let mut server = Server::saying_more(&dir.path().join("data"), &endpoint, &log);
    let session = client(&endpoint).await;
    until_up(&session).await;
    // The robot's name is what its author is made of.
    let ana = AuthorId::of_robot("ana");
    session.put(key(ana, 1), bytes(ana, 1)).await.unwrap();
    head_when(&session, |head| head.version == 1).await;
    let token = session.liveliness().declare_token("fht/museum/robots/ana").await.unwrap();
    let blocked = r#"{"for_s": 2, "places": [[1.0, 2.0]]}"#;
    session.put("fht/museum/robots/ana/blocked", blocked).await.unwrap();
    crate::support::ask(&session, "fht/museum/path?from=0,0;to=nowhere").await;
    let begin = Instant::now();
    loop {
        let said = std::fs::read_to_string(&log).unwrap();
        let is_said = |parts: &[&str]| said.lines().any(|line| parts.iter().all(|part| line.contains(part)));
        let all = [
            &["map=museum", "is here", "robot=ana"][..],
            &["map=museum", "blocked", "robot=ana"][..],
            &["map=museum", "asked=fht/museum/path?from=0,0;to=nowhere", "UnknownPlace"][..],
            &["map=museum", "asked=fht/museum/head", "answered"][..],
        ];
        session.put(key(ana, 2), bytes(ana, 2)).await.unwrap();
        if all.iter().all(|parts| is_said(parts)) && is_said(&["map=museum", "robot=ana", "stored"]) {
            break;
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "{said}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    drop(token);
    assert_eq!(server.terminate(), Some(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn it_ends_when_told_to_and_says_why_it_cannot_start() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("maps/of/the/museum");
    let endpoint = free_endpoint();
    let mut server = Server::start(&data, &endpoint);
    until_up(&client(&endpoint).await).await;

    let (code, said) = refused_start(&data, &free_endpoint());
    assert!(code == Some(1) && said.contains("in use by another map-server"), "{said}");
    let (code, said) = refused_start(&dir.path().join("other"), &endpoint);
    assert!(code == Some(1) && said.contains("in use"), "{said}");
    let file = dir.path().join("file");
    std::fs::write(&file, "x").unwrap();
    let (code, said) = refused_start(&file, &free_endpoint());
    assert!(code == Some(1) && said.contains("cannot be used"), "{said}");
    let junk = dir.path().join("junk");
    std::fs::create_dir(&junk).unwrap();
    std::fs::write(junk.join("maps.redb"), "not a database").unwrap();
    let (code, said) = refused_start(&junk, &free_endpoint());
    assert!(code == Some(1) && said.contains("cannot be used"), "{said}");
    let (code, said) = refused_start(&data, "nonsense");
    assert!(code == Some(2) && said.contains("'nonsense' is not an endpoint"), "{said}");

    assert_eq!(server.terminate(), Some(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_second_server_with_a_log_of_its_own_says_that_another_answers() {
    let dir = tempfile::tempdir().unwrap();
    let (first, second) = (free_endpoint(), free_endpoint());
    let logs = [dir.path().join("first.log"), dir.path().join("second.log")];
    let said = |number: usize| std::fs::read_to_string(&logs[number]).unwrap();
    let _first = Server::with(&dir.path().join("a"), &first, &[], &logs[0]);
    until_up(&client(&first).await).await;
    let _second = Server::with(&dir.path().join("b"), &second, &["--connect", &first], &logs[1]);
    let begin = Instant::now();
    while !said(1).contains("another map-server answers here") {
        assert!(begin.elapsed() < Duration::from_secs(60), "{}", said(1));
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    // The first was alone when it started.
    assert!(!said(0).contains("another"), "{}", said(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_listens_says_for_how_long_no_router_is_there() {
    const WAITING: &str = "waiting for a server or router: ";
    let dir = tempfile::tempdir().unwrap();
    let (endpoint, router) = (free_endpoint(), free_endpoint());
    let logs = [dir.path().join("server.log"), dir.path().join("router.log")];
    let said = || std::fs::read_to_string(&logs[0]).unwrap();
    let _server = Server::with(&dir.path().join("a"), &endpoint, &["--connect", &router], &logs[0]);
    let begin = Instant::now();
    while said().matches(WAITING).count() < 2 {
        assert!(begin.elapsed() < Duration::from_secs(60), "{}", said());
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert!(said().contains(&format!("{WAITING}{router}: nobody listens there")), "{}", said());
    assert!(said().contains(&format!(", on {endpoint}, connecting to {router}")), "{}", said());
    let _router = Server::with(&dir.path().join("b"), &router, &[], &logs[1]);
    // Zenoh tries again every four seconds at least; a busy machine starts a router slowly.
    let begin = Instant::now();
    let (mut count, mut since) = (said().matches(WAITING).count(), Instant::now());
    while since.elapsed() < Duration::from_secs(8) {
        assert!(begin.elapsed() < Duration::from_secs(90), "{}", said());
        tokio::time::sleep(Duration::from_millis(100)).await;
        let now = said().matches(WAITING).count();
        if now != count {
            (count, since) = (now, Instant::now());
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn routers_know_the_keys_of_each_map() {
    let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
    let _server = Server::start(dir.path(), &endpoint);
    let session = client(&endpoint).await;
    until_up(&session).await;
    session.put(key(ANA, 1), bytes(ANA, 1)).await.unwrap();
    // Whoever publishes under a key learns that somebody has declared it.
    for topic in ["head", "path", "since", "rules", "snapshot"] {
        let publisher = session.declare_publisher(format!("fht/museum/{topic}")).await.unwrap();
        let begin = Instant::now();
        while !publisher.matching_status().await.unwrap().matching() {
            assert!(begin.elapsed() < Duration::from_secs(20), "{topic}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}
