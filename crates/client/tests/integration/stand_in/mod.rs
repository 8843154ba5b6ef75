//! A stand-in for the map server, which answers `head` and `since` from a log.

use fht_map::MapState;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{Head, Series};
use fht_proto::{AuthorId, FixedPose, Increment, MapName, NodeId, NodeKind, Op, VersionVector, encode};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use zenoh::{Session, Wait};

pub const WAIT: Duration = Duration::from_secs(20);

pub fn increment(number: u64) -> Increment {
    let author = AuthorId::of_robot("explorer");
    let id = NodeId { author, number: number as u32 };
    let pose = FixedPose::from_metres(number as f64, 0.0, 0.0);
    Increment { author, number, hlc_us: number, ops: vec![Op::PutNode { id, kind: NodeKind::Support, pose }] }
}

pub fn vector(count: usize) -> VersionVector {
    let mut vector = VersionVector::default();
    vector.set(AuthorId::of_robot("explorer"), count as u64);
    vector
}

pub fn head(map: &MapName, log: &[Increment]) -> Vec<u8> {
    let mut state = MapState::new();
    log.iter().for_each(|increment| state.apply(increment));
    let vector = vector(log.len());
    let head = Head {
        version: vector.version(),
        vector,
        digest: state.digest(),
        clock_us: state.max_hlc_us(),
        support_nodes: log.len(),
        ..Head::of_nothing(map.clone())
    };
    serde_json::to_vec(&head).expect("JSON")
}

/// Answers `head` and `since` from a log.
pub fn serve(session: &Session, map: &MapName, log: &Arc<Mutex<Vec<Increment>>>) {
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
            let series = Series { increments: lacking.take(3).cloned().collect(), ..Series::default() };
            let _ = query.reply(query.key_expr().clone(), encode(&series).expect("bytes")).wait();
        })
        .background()
        .wait()
        .expect("queryable");
}

pub async fn listen() -> (Session, String) {
    let endpoint = format!("tcp/{}", fht_reserved_port::reserve().expect("a port"));
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"router\"").expect("mode");
    config.insert_json5("listen/endpoints", &format!("[\"{endpoint}\"]")).expect("endpoint");
    config.insert_json5("scouting/multicast/enabled", "false").expect("scouting");
    (zenoh::open(config).await.expect("a session"), endpoint)
}
