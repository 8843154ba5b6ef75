//! What arrives under a map's keys is not what the server has: forged, misplaced, refused by the
//! server, or too much at once.

use crate::stand_in::{WAIT, head, increment, listen, serve, vector};
use fht_client::{LiveReplica, ReplicaConfig};
use fht_map::MapState;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{Head, Series};
use fht_proto::{AuthorId, Digest, Increment, MapName, encode};
use fht_session::{SessionConfig, open};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait};

struct Scene {
    server: Session,
    client: Session,
    map: MapName,
    log: Arc<Mutex<Vec<Increment>>>,
    replica: LiveReplica,
}

impl Scene {
    /// A server with `count` increments and a replica that has them.
    async fn with(count: u64, config: ReplicaConfig) -> Self {
        let map: MapName = "m".parse().expect("name");
        let (server, endpoint) = listen().await;
        let log: Arc<Mutex<Vec<Increment>>> = Arc::new(Mutex::new((1..=count).map(increment).collect()));
        serve(&server, &map, &log);
        let client = open(&SessionConfig::from_options(vec![endpoint], None)).await.expect("a session");
        let replica = LiveReplica::start(&client, &map, "r", config).expect("a replica");
        let scene = Self { server, client, map, log, replica };
        tokio::task::block_in_place(|| assert!(scene.replica.wait_for(&vector(count as usize), WAIT), "catching up"));
        scene
    }

    fn put(&self, number: u64, bytes: Vec<u8>) {
        let key = Key::increment(&self.map, AuthorId::of_robot("explorer"), number).to_string();
        self.server.put(key, bytes).congestion_control(CongestionControl::Block).wait().expect("put");
    }

    /// The digest of the server's map.
    fn truth(&self) -> Digest {
        let mut state = MapState::new();
        self.log.lock().expect("log").iter().for_each(|increment| state.apply(increment));
        state.digest()
    }

    fn digest(&self) -> Digest {
        self.replica.read().state().digest()
    }

    fn wait_until(&self, what: &str, done: impl Fn(&Self) -> bool) {
        let deadline = Instant::now() + WAIT;
        while !done(self) {
            assert!(Instant::now() < deadline, "{what}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Asks often and waits briefly, so that the tests are short.
fn quick() -> ReplicaConfig {
    ReplicaConfig { ahead_s: 0.5, head_every_s: 0.1, ..ReplicaConfig::default() }
}

/// Increment `number` as the server never had it.
fn forged(number: u64) -> Vec<u8> {
    encode(&Increment { hlc_us: 77, ..increment(number) }).expect("bytes")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_the_server_has_otherwise_is_let_go() {
    let scene = Scene::with(8, quick()).await;
    tokio::task::block_in_place(|| {
        // Nine comes forged, and true only to the server.
        scene.put(9, forged(9));
        scene.wait_until("the forged one goes in", |scene| scene.replica.read().vector().covers(&vector(9)));
        let believed = scene.digest();
        scene.log.lock().expect("log").push(increment(9));
        assert_ne!(believed, scene.truth());
        scene.wait_until("the server's nine", |scene| scene.digest() == scene.truth());
        assert_eq!(scene.replica.read().vector(), &vector(9));
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_the_server_never_takes_is_let_go() {
    let scene = Scene::with(8, quick()).await;
    tokio::task::block_in_place(|| {
        (9..=12).for_each(|number| scene.put(number, forged(number)));
        scene.wait_until("they go in", |scene| scene.replica.read().vector().covers(&vector(12)));
        scene.wait_until("and out again", |scene| scene.replica.read().vector() == &vector(8));
        assert_eq!(scene.digest(), scene.truth());
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_conflict_is_settled_by_the_server() {
    // Only the conflict can tell: nobody compares heads here.
    let scene = Scene::with(8, ReplicaConfig { head_every_s: 1000.0, ..quick() }).await;
    tokio::task::block_in_place(|| {
        scene.put(9, forged(9));
        scene.wait_until("the forged one goes in", |scene| scene.replica.read().vector().covers(&vector(9)));
        scene.log.lock().expect("log").push(increment(9));
        scene.put(9, encode(&increment(9)).expect("bytes"));
        scene.wait_until("the server's nine", |scene| scene.digest() == scene.truth());
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_under_a_wrong_key_is_refused() {
    let scene = Scene::with(8, quick()).await;
    tokio::task::block_in_place(|| {
        let bytes = |number| encode(&increment(number)).expect("bytes");
        let stranger = Increment { author: AuthorId(7), ..increment(1) };
        scene.put(10, bytes(9));
        scene.put(9, encode(&stranger).expect("bytes"));
        scene.put(
            9,
            encode(&Series { increments: vec![increment(9), increment(10)], ..Series::default() }).expect("bytes"),
        );
        let deeper = format!("fht/m/inc/{}/9/9", AuthorId::of_robot("explorer"));
        scene.server.put(deeper, bytes(9)).wait().expect("put");
        scene.wait_until("all four are refused", |scene| scene.replica.refused() == 4);
        assert_eq!(scene.replica.read().vector(), &vector(8));
        scene.log.lock().expect("log").push(increment(9));
        scene.put(9, bytes(9));
        scene.wait_until("the true one goes in", |scene| scene.digest() == scene.truth());
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_impossible_head_does_no_harm() {
    let scene = Scene::with(8, quick()).await;
    tokio::task::block_in_place(|| {
        let mut wrong: Head = serde_json::from_slice(&head(&scene.map, &[])).expect("head");
        wrong.vector.set(AuthorId::of_robot("explorer"), u64::MAX);
        wrong.vector.set(AuthorId(3), u64::MAX);
        wrong.version = wrong.vector.version();
        let json = serde_json::to_vec(&wrong).expect("JSON");
        scene.server.put(Key::topic(&scene.map, Topic::Head).to_string(), json).wait().expect("put");
        scene.log.lock().expect("log").push(increment(9));
        scene.put(9, encode(&increment(9)).expect("bytes"));
        scene.wait_until("the map goes on", |scene| scene.digest() == scene.truth());
    });
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_queue_holds_nobody_back() {
    const COUNT: u64 = 500;
    let scene = Scene::with(8, ReplicaConfig { queue: 4, ..quick() }).await;
    tokio::task::block_in_place(|| {
        let other = scene.client.declare_subscriber("other").wait().expect("a subscriber");
        {
            // Whoever reads long keeps the replica from taking anything in.
            let _reading = scene.replica.read();
            for number in 9..=COUNT {
                scene.log.lock().expect("log").push(increment(number));
                scene.put(number, encode(&increment(number)).expect("bytes"));
            }
            // The server may hear late that there is somebody to put for.
            scene.wait_until("the session's other subscriber is kept waiting", |scene| {
                scene.server.put("other", "heard").congestion_control(CongestionControl::Block).wait().expect("put");
                other.try_recv().expect("a session that is alive").is_some()
            });
        }
        assert!(scene.replica.dropped() > 0);
        assert!(scene.replica.wait_for(&vector(COUNT as usize), WAIT), "what was dropped is asked for");
        assert_eq!(scene.digest(), scene.truth());
    });
}
