//! One increment in the store that cannot be read keeps its own map offline, and no other.

use crate::support::{ANA, BEN, Server, ask, client, expected, free_endpoint, increment, until_up};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, MapsReply};
use fht_proto::{MapName, encode};
use map_server::store::FILE_NAME;
use redb::{ReadableTable, TableDefinition};
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use zenoh::Session;

const INCREMENTS: TableDefinition<'_, (&str, u32, u64), &[u8]> = TableDefinition::new("increments");

fn key(map: &str, number: u64) -> String {
    Key::increment(&map.parse().unwrap(), ANA, number).to_string()
}

async fn write(session: &Session, map: &str, first: u64, last: u64) {
    for number in first..=last {
        session.put(key(map, number), encode(&increment(ANA, number)).unwrap()).await.unwrap();
    }
}

async fn asked_head(session: &Session, map: &str) -> Result<Head, ErrorReply> {
    let reply = ask(session, &format!("fht/{map}/head")).await.remove(0);
    reply.map(|bytes| serde_json::from_slice(&bytes).unwrap())
}

async fn until_at(session: &Session, map: &str, version: u64) {
    for _ in 0..500 {
        if asked_head(session, map).await.is_ok_and(|head| head.version == version) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("map {map} did not get to version {version}");
}

/// Changes one byte of an increment in the store, whose sums then hold all the same.
fn damage(data: &Path, map: &str, number: u64) {
    let store = redb::Database::open(data.join(FILE_NAME)).unwrap();
    let write = store.begin_write().unwrap();
    let mut increments = write.open_table(INCREMENTS).unwrap();
    let place = (map, ANA.0, number);
    let mut bytes = increments.get(place).unwrap().unwrap().value().to_vec();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    increments.insert(place, bytes.as_slice()).unwrap();
    drop(increments);
    write.commit().unwrap();
}

fn run(args: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_map-server")).args(args).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout) + &text(output.stderr))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_damaged_increment_takes_its_own_map_offline_and_no_other() {
    let dir = tempfile::tempdir().unwrap();
    let (data, endpoint) = (dir.path().join("data"), free_endpoint());
    let mut server = Server::start(&data, &endpoint);
    let session = client(&endpoint).await;
    until_up(&session).await;
    for map in ["attic", "cellar", "museum"] {
        write(&session, map, 1, 20).await;
        until_at(&session, map, 20).await;
    }
    assert_eq!(server.terminate(), Some(0));
    damage(&data, "cellar", 7);

    let log = dir.path().join("log");
    let server = Server::with(&data, &endpoint, &[], &log);
    until_up(&session).await;
    let maps: MapsReply = serde_json::from_slice(ask(&session, "fht/maps").await[0].as_ref().unwrap()).unwrap();
    let listed: Vec<(&str, bool)> = maps.maps.iter().map(|head| (head.map.as_str(), head.damaged)).collect();
    assert_eq!(listed, [("attic", false), ("cellar", true), ("museum", false)]);
    let (_, said) = run(&["health", "--connect", &endpoint]);
    assert!(said.contains("cellar is damaged"), "{said}");
    let said = std::fs::read_to_string(&log).unwrap();
    assert!(said.contains("map cellar is damaged") && said.contains("0000000a/7"), "{said}");

    // Questions and increments to it are answered with a code; nothing begins it anew.
    let refused = session.declare_subscriber(format!("fht/cellar/refused/{ANA}")).await.unwrap();
    for topic in ["head", "since", "path?from=0,0;to=3,0", "nodes?near=0,0", "rules", "fleet", "releases", "journal"] {
        let reply = ask(&session, &format!("fht/cellar/{topic}")).await.remove(0).unwrap_err();
        assert_eq!(reply.code, ErrorCode::Damaged, "{topic}");
        assert!(reply.message.contains("map-server rescue"), "{reply}");
    }
    for number in [1, 21] {
        write(&session, "cellar", number, number).await;
    }
    let sample = tokio::time::timeout(Duration::from_secs(10), refused.recv_async()).await.unwrap().unwrap();
    let reply: ErrorReply = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
    assert!(reply.code == ErrorCode::Damaged && !reply.code.is_permanent_refusal(), "{reply}");

    // The others are as they were, and grow.
    for map in ["attic", "museum"] {
        write(&session, map, 21, 25).await;
        until_at(&session, map, 25).await;
        assert_eq!(asked_head(&session, map).await.unwrap().digest, expected(&[(ANA, 25)]).0.digest());
    }
    drop(server);

    // It is named, and what reads of it can be had.
    let store = data.to_str().unwrap();
    let (code, said) = run(&["check", store]);
    assert!(code == Some(1) && said.contains("map cellar: increment 0000000a/7"), "{said}");
    let rescued = dir.path().join("rescued");
    let (code, said) = run(&["rescue", store, rescued.to_str().unwrap()]);
    assert!(code == Some(1) && said.contains("map cellar, author 0000000a: 19 of 20 increments rescued"), "{said}");
    let _server = Server::start(&rescued, &endpoint);
    until_up(&session).await;
    for (map, version) in [("attic", 25), ("cellar", 20), ("museum", 25)] {
        until_at(&session, map, version).await;
    }
    let map: MapName = "cellar".parse().unwrap();
    let next = Key::increment(&map, BEN, 1).to_string();
    session.put(next, encode(&increment(BEN, 1)).unwrap()).await.unwrap();
    until_at(&session, "cellar", 21).await;
}
