//! A replica over Zenoh on loopback, against a stand-in for the server: late joining, live
//! increments, lost ones, rubbish.

use crate::stand_in::{WAIT, head, increment, listen, serve, vector};
use fht_client::{LiveReplica, ReplicaConfig};
use fht_map::MapState;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::{AuthorId, Increment, MapName, encode};
use fht_session::{SessionConfig, open};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use zenoh::Wait;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_late_replica_catches_up_follows_and_recovers() {
    let map: MapName = "m".parse().expect("name");
    let (server, endpoint) = listen().await;
    let log: Arc<Mutex<Vec<Increment>>> = Arc::new(Mutex::new((1..=8).map(increment).collect()));
    serve(&server, &map, &log);
    let client = open(&SessionConfig::from_options(vec![endpoint], None)).await.expect("a session");
    let replica = LiveReplica::start(&client, &map, "r", ReplicaConfig::default()).expect("a replica");

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
