//! Replicated storages in routers with mutual TLS and access control: they hold what servers put,
//! and nobody else can put or delete anything there.

use crate::programs::executable;
use crate::site::{MOMENT, PATIENCE, author, free_endpoint, guarded, in_file, increment, museum, shipped, write};
use fht_demo::Process;
use fht_proto::api::keys::Key;
use fht_proto::encode;
use fht_session::SessionConfig;
use std::path::Path;
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::query::{ConsolidationMode, QueryTarget};

/// A router of `deploy/` with access control, and with the storages in memory, as a process.
fn with_storages(dir: &Path, own: &str, listen: &str, others: &[&str]) -> Process {
    let mut config: serde_json::Value = json5::from_str(&guarded("router.json5", own, &[listen])).unwrap();
    let mut plugins =
        json5::from_str::<serde_json::Value>(&crate::site::read("storages.json5")).unwrap()["plugins"].take();
    let manager = &mut plugins["storage_manager"];
    manager["volumes"] = serde_json::json!({});
    manager["storages"]["increments"]["volume"] = "memory".into();
    manager["storages"]["increments"]["replication"]["interval"] = 1.into();
    config["plugins"] = plugins;
    config["connect"]["endpoints"] = others.into();
    let file = in_file(dir, own, &config.to_string());
    let handoff = executable();
    let mut router = Process::start(handoff, fht_tests::router::NAME, ["-c".as_ref(), file.as_os_str()]).unwrap();
    router.wait_until_listening(&listen.replace("tls/", "tcp/"), PATIENCE).unwrap();
    router
}

/// What each storage holds under keys, as an operator may ask.
async fn held(operator: &Session, keys: &str) -> Vec<(String, Vec<u8>)> {
    let ask = operator.get(keys).target(QueryTarget::All).consolidation(ConsolidationMode::None);
    let replies = ask.timeout(Duration::from_secs(3)).await.unwrap();
    let mut held = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        let sample = reply.result().unwrap();
        held.push((sample.key_expr().to_string(), sample.payload().to_bytes().into_owned()));
    }
    held
}

/// The same, once `count` values are held, and no others: routes to a router that has just joined
/// take a moment.
async fn held_once(count: usize, operator: &Session, keys: &str) -> Vec<(String, Vec<u8>)> {
    let start = Instant::now();
    loop {
        let held = held(operator, keys).await;
        if held.len() == count {
            return held;
        }
        assert!(start.elapsed() < PATIENCE, "{} values instead of {count}: {held:?}", held.len());
        tokio::time::sleep(MOMENT).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn storages_hold_what_servers_put_and_nobody_else() {
    let (first, second) = (free_endpoint(), free_endpoint());
    let dir = tempfile::tempdir().unwrap();
    let mut a = with_storages(dir.path(), "router-a", &first, &[]);
    let _b = with_storages(dir.path(), "router-b", &second, &[&first]);
    let server = |number: usize, at: &str| {
        let file =
            in_file(dir.path(), &format!("server-{number}"), &shipped("server.json5", "server-maps", &[], &[at]));
        let link = map_server::ServerEndpoints { zenoh_config: Some(file), ..Default::default() };
        let storages = Some(map_server::QuorumConfig::majority(2));
        let config = map_server::ServerConfig { storages, ..map_server::ServerConfig::new("unused".into(), link) };
        let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
        (stop, tokio::spawn(map_server::run(config, async { _ = stopped.await })))
    };
    let session = async |file: &str, own: &str| {
        let file = in_file(dir.path(), own, &shipped(file, own, &[], &[&second]));
        fht_session::open(&SessionConfig::from_options(Vec::new(), Some(file))).await.unwrap()
    };
    let ana = session("explorer.json5", "explorer-ana").await;
    let desk = session("operator.json5", "operator-desk").await;
    let servers = [server(1, &first), server(2, &second)];
    assert_eq!(mapper::publish::find_head(&ana, &museum(), PATIENCE).await.unwrap(), None);
    let head = write(&ana, "ana", 1).await;
    assert_eq!(head.vector.get(author("ana")), 1);
    let keys = "fht/museum/kept/**";
    let both = held_once(2, &desk, keys).await;
    assert!(both.iter().all(|(_, bytes)| *bytes == encode(&increment("ana", 1)).unwrap()));

    // Neither an explorer nor an operator can put or delete anything there, not even under its own
    // name.
    for (liar, name) in [(&ana, "ana"), (&desk, "desk")] {
        for number in [1, 2] {
            let key = Key::kept(&museum(), author(name), number).to_string();
            liar.put(key.as_str(), "lies").await.unwrap();
        }
        liar.delete(Key::kept(&museum(), author("ana"), 1).to_string()).await.unwrap();
        liar.delete(keys).await.unwrap();
    }
    tokio::time::sleep(MOMENT).await;
    assert_eq!(held_once(2, &desk, keys).await, both);
    assert_eq!(write(&ana, "ana", 2).await.version, 2);
    // What every storage would have to forget is not deleted.
    let order = br#"{"grace_s": 0, "reason": "mistyped", "by": "desk"}"#.to_vec();
    let refused = crate::site::ask_with(&desk, "fht/museum/admin/delete", order).await.remove(0).unwrap_err();
    assert!(refused.contains("maps are deleted only where one server keeps its own log"), "{refused}");

    for (stop, ended) in servers {
        stop.send(()).unwrap();
        ended.await.unwrap().unwrap();
    }
    // Only what the storages hold is left; a new router gets it from the other.
    a.kill().unwrap();
    let _a = with_storages(dir.path(), "router-a", &first, &[&second]);
    held_once(4, &desk, keys).await;
    let (stop, ended) = server(3, &first);
    let found = mapper::publish::find_head(&ana, &museum(), PATIENCE).await.unwrap().unwrap();
    assert_eq!((found.version, found.vector.get(author("ana"))), (2, 2));
    stop.send(()).unwrap();
    ended.await.unwrap().unwrap();
    for session in [ana, desk] {
        session.close().await.unwrap();
    }
}
