//! A replica over Zenoh on loopback, against a stand-in for the server: late joining, live increments, lost ones, rubbish.

use client_robot::replica::{LiveReplica, ReplicaConfig};
use fht_map::MapState;
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{Head, Snapshot};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector, encode};
use fht_robot::link::{LinkConfig, open};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

const WAIT: Duration = Duration::from_secs(20);

fn increment(number: u64) -> Increment {
    let author = AuthorId::of_robot("explorer");
    let id = NodeId { author, number: number as u32 };
    let pose = FixedPose::from_metres(number as f64, 0.0, 0.0);
    Increment { author, number, hlc_us: number, ops: vec![Op::PutNode { id, kind: NodeKind::Support, pose }] }
}

fn vector(count: usize) -> VersionVector {
    let mut vector = VersionVector::default();
    vector.set(AuthorId::of_robot("explorer"), count as u64);
    vector
}

fn head(map: &MapName, log: &[Increment]) -> Vec<u8> {
    let mut state = MapState::new();
    log.iter().for_each(|increment| state.apply(increment));
    let vector = vector(log.len());
    let head = Head {
        map: map.clone(),
        version: vector.version(),
        vector,
        digest: state.digest(),
        main_nodes: 0,
        support_nodes: log.len(),
        edges: 0,
        bytes: 0,
        refused: 0,
    };
    serde_json::to_vec(&head).expect("JSON")
}

/// Answers `head` and `since` from a log.
fn serve(session: &Session, map: &MapName, log: &Arc<Mutex<Vec<Increment>>>) {
    let (name, held) = (map.clone(), Arc::clone(log));
    let head_key = Key::topic(map, Topic::Head).to_string();
    session
        .declare_queryable(&head_key)
        .callback(move |query| {
            let bytes = head(&name, &held.lock().expect("log"));
            let _ = query.reply(query.key_expr().clone(), bytes).wait();
        })
        .background()
        .wait()
        .expect("queryable");
    let held = Arc::clone(log);
    session
        .declare_queryable(Key::topic(map, Topic::Since).to_string())
        .callback(move |query| {
            let known: VersionVector = query.parameters().get("vector").unwrap_or_default().parse().expect("vector");
            // Three at most: a replica has to ask again.
            let held = held.lock().expect("log");
            let lacking = held.iter().filter(|increment| increment.number > known.get(increment.author));
            let series = Snapshot { increments: lacking.take(3).cloned().collect() };
            let _ = query.reply(query.key_expr().clone(), encode(&series).expect("bytes")).wait();
        })
        .background()
        .wait()
        .expect("queryable");
}

async fn listen() -> (Session, String) {
    let port = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a port").port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"router\"").expect("mode");
    config.insert_json5("listen/endpoints", &format!("[\"{endpoint}\"]")).expect("endpoint");
    config.insert_json5("scouting/multicast/enabled", "false").expect("scouting");
    (zenoh::open(config).await.expect("a session"), endpoint)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_replica_catches_up_follows_and_recovers() {
    let map: MapName = "m".parse().expect("name");
    let (server, endpoint) = listen().await;
    let log: Arc<Mutex<Vec<Increment>>> = Arc::new(Mutex::new((1..=8).map(increment).collect()));
    serve(&server, &map, &log);
    let client = open(&LinkConfig { connect: vec![endpoint] }).await.expect("a session");
    let replica = LiveReplica::start(&client, &map, ReplicaConfig::default()).expect("a replica");

    tokio::task::spawn_blocking(move || {
        assert!(replica.wait_for(&vector(8), WAIT), "catching up");

        let put = |number: u64, bytes: Vec<u8>| {
            let key = Key::increment(&map, AuthorId::of_robot("explorer"), number).to_string();
            server.put(key, bytes).wait().expect("put");
        };
        log.lock().expect("log").push(increment(9));
        put(9, encode(&increment(9)).expect("bytes"));
        assert!(replica.wait_for(&vector(9), WAIT), "live");

        // Ten is lost on the way; eleven comes, and the head tells.
        log.lock().expect("log").extend([increment(10), increment(11)]);
        put(11, encode(&increment(11)).expect("bytes"));
        let state = head(&map, &log.lock().expect("log"));
        server.put(Key::topic(&map, Topic::Head).to_string(), state).wait().expect("put");
        assert!(replica.wait_for(&vector(11), WAIT), "recovery of a lost increment");

        put(12, b"rubbish".to_vec());
        let deadline = Instant::now() + WAIT;
        while replica.refused() == 0 && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(10));
        }
        assert_eq!(replica.refused(), 1);
        assert_eq!(replica.read().state().counts().support_nodes, 11);
        let mut expected = MapState::new();
        log.lock().expect("log").iter().for_each(|increment| expected.apply(increment));
        assert_eq!(replica.read().state().digest(), expected.digest());
    })
    .await
    .expect("no panic");
}
