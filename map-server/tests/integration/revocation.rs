//! A robot is not trusted any more, while the server serves: it writes nothing from then on, and
//! what it wrote is taken back, but for what others have changed since.

use crate::support::{Server, ask, client, free_endpoint, head_when, museum, node, until_up};
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{ErrorCode, ErrorReply};
use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, NodeKind, Op, encode};
use serde_json::Value;
use std::process::Command;
use std::time::{Duration, Instant, UNIX_EPOCH};

fn author(name: &str) -> AuthorId {
    AuthorId::of_robot(name)
}

fn increment(name: &str, number: u64, ops: Vec<Op>) -> Increment {
    Increment { author: author(name), number, hlc_us: UNIX_EPOCH.elapsed().unwrap().as_micros() as u64, ops }
}

fn put_node(name: &str, number: u32, x: f64) -> Op {
    let id = node(author(name), number);
    Op::PutNode { id, kind: NodeKind::Support, pose: FixedPose::from_metres(x, 0.0, 0.0) }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_is_revoked_while_the_server_serves() {
    let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
    let (roles, log) = (dir.path().join("roles.json5"), dir.path().join("log"));
    std::fs::write(&roles, "{explorers: ['ana', 'ben'], operators: ['desk']}").unwrap();
    let args = ["--roles", roles.to_str().unwrap()];
    let server = Server::with(&dir.path().join("data"), &endpoint, &args, &log);
    let session = client(&endpoint).await;
    until_up(&session).await;
    let put = async |increment: Increment| {
        let key = Key::increment(&museum(), increment.author, increment.number).to_string();
        session.put(key, encode(&increment).unwrap()).await.unwrap();
    };
    put(increment("ana", 1, vec![put_node("ana", 0, 0.0)])).await;
    head_when(&session, |head| head.version == 1).await;
    let (own, other) = (node(author("ben"), 0), node(author("ana"), 0));
    let edge = EdgeKey::new(own, other);
    let of_ben = vec![put_node("ben", 0, 1.0), put_node("ben", 1, 2.0), Op::PutEdge { edge }];
    put(increment("ben", 1, of_ben)).await;
    head_when(&session, |head| head.version == 2).await;
    // Of what ben made, ana has taken a node away.
    put(increment("ana", 2, vec![Op::RemoveNode { id: node(author("ben"), 1) }])).await;
    head_when(&session, |head| head.version == 3 && head.support_nodes == 2).await;

    // A list that cannot be read changes nothing.
    for text in ["{explorers: ['ana'", "{explorers: ['ana'], operators: ['desk']}"] {
        std::fs::write(&roles, text).unwrap();
        server.signal("HUP");
        let expected = if text.ends_with('}') { "not any more: ben" } else { "stays as it was" };
        let begin = Instant::now();
        while !std::fs::read_to_string(&log).unwrap().contains(expected) {
            assert!(begin.elapsed() < Duration::from_secs(30), "{}", std::fs::read_to_string(&log).unwrap());
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    let told = session.declare_subscriber(Key::refused(&museum(), author("ben")).to_string()).await.unwrap();
    put(increment("ben", 2, vec![put_node("ben", 2, 3.0)])).await;
    let sample = tokio::time::timeout(Duration::from_secs(30), told.recv_async()).await.unwrap().unwrap();
    let refusal: ErrorReply = serde_json::from_slice(&sample.payload().to_bytes()).unwrap();
    assert_eq!(refusal.code, ErrorCode::NotPermitted, "{refusal}");

    let run = |args: &[&str]| -> Value {
        let program = env!("CARGO_BIN_EXE_map-server");
        let common = ["--connect", &endpoint, "--json", "--operator", "desk"];
        let output = Command::new(program).args(args).args(common).output().unwrap();
        assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    run(&["undo", "museum", "--author", "ben", "--all"]);
    let head = head_when(&session, |head| head.version == 4).await;
    assert_eq!((head.support_nodes, head.edges), (1, 0), "ana's node is left");
    let since = ask(&session, "fht/museum/since?fmt=json").await.remove(0).unwrap();
    let since: Value = serde_json::from_slice(&since).unwrap();
    assert!(since.to_string().contains(&author("ben").to_string()), "its increments stay in the log");
}
