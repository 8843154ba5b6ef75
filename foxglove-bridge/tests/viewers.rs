//! Viewers and readers that are not ours: a client of Foxglove's own library sees the map, is told
//! what has changed and not the whole scene each time, and asks for a path; what was recorded shows
//! other people's MCAP reader the same.
#![allow(clippy::unwrap_used)] // tests may panic

#[path = "../../tests/src/packages.rs"]
#[allow(dead_code)] // other tests use more of it
mod packages;
mod support;

use fht_proto::{EdgeKey, FixedPose, Op, Zone, ZoneRule};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use support::{Site, drive, node, until};
use zenoh::liveliness::LivelinessToken;

const TOPICS: [&str; 6] = ["/map/scene", "/map/grid", "/robots/scene", "/robots/poses", "/tf", "/path"];

/// A viewer of Foxglove's library in Node.js, killed when dropped.
struct Viewer(RefCell<(Child, BufReader<ChildStdout>)>);

impl Viewer {
    fn of(url: &str, protocol: &str) -> Self {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/viewer");
        packages::node_packages(&folder);
        let mut node = Command::new("node");
        let pipes = node.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = pipes.arg(folder.join("view.mjs")).args([url, protocol]).spawn().unwrap();
        let answers = BufReader::new(child.stdout.take().unwrap());
        Self(RefCell::new((child, answers)))
    }

    fn ask(&self, order: &Value) -> Value {
        let (child, answers) = &mut *self.0.borrow_mut();
        writeln!(child.stdin.as_mut().unwrap(), "{order}").unwrap();
        let mut line = String::new();
        answers.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{order}: {error}: {line}"))
    }

    fn subscribe(&self, topics: &[&str]) {
        self.ask(&json!({ "order": "subscribe", "topics": topics }));
    }

    fn call(&self, service: &str, request: &Value) -> Value {
        self.ask(&json!({ "order": "call", "service": service, "request": request }))
    }

    async fn sees(&self, what: &str, is_so: impl Fn(&Value) -> bool) -> Value {
        let look = || async {
            let seen = self.ask(&json!({ "order": "see" }));
            assert_eq!(seen["closed"], Value::Null, "{seen}");
            is_so(&seen).then_some(seen)
        };
        until(what, look).await
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let child = &mut self.0.get_mut().0;
        let _ = child.kill();
        let _ = child.wait();
    }
}

fn has(seen: &Value, topic: &str, id: &str) -> bool {
    seen["scenes"][topic].as_array().is_some_and(|ids| ids.iter().any(|known| known == id))
}

fn count(seen: &Value, topic: &str) -> usize {
    seen["scenes"][topic].as_array().map_or(0, Vec::len)
}

/// All numbers in there, one after the other. What is whole has no point after it in JavaScript.
fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        _ => value.as_f64().into_iter().collect(),
    }
}

/// Places, zones and a closed edge.
fn annotations() -> Vec<Op> {
    let corners = [(2.0, -1.0), (4.0, -1.0), (4.0, 1.0)].map(|(x, y)| FixedPose::from_metres(x, y, 0.0).position);
    let zone = Zone { rule: ZoneRule::SpeedLimit(300), corners: corners.to_vec() };
    vec![
        Op::SetPlace { name: "Küche".parse().unwrap(), pose: Some(FixedPose::from_metres(9.0, 0.0, 0.5)) },
        Op::SetZone { name: "wet-floor".parse().unwrap(), zone: Some(zone) },
        Op::SetClosed { edge: EdgeKey::new(node(0), node(1)), closed: true },
    ]
}

/// What a viewer and who reads the recording must have seen.
fn check(seen: &Value) {
    let schema = |topic: &str| seen["channels"][topic].as_str().unwrap_or_default().to_owned();
    let schemas = ["SceneUpdate", "Grid", "SceneUpdate", "PosesInFrame", "FrameTransforms", "PosesInFrame"];
    for (topic, name) in TOPICS.into_iter().zip(schemas) {
        assert_eq!(schema(topic), format!("foxglove.{name}"), "{topic}");
        assert!(seen["counts"][topic].as_u64().is_some_and(|count| count > 0), "{topic}: {seen}");
    }
    // 21 nodes but one, 20 edges but the two at that node, a place, a zone.
    assert_eq!(count(seen, "/map/scene"), 20 + 18 + 1 + 1, "{seen}");
    for id in ["node 0000000a.20", "edge 0000000a.19 0000000a.20", "place Küche", "zone wet-floor"] {
        assert!(has(seen, "/map/scene", id), "{id}: {seen}");
    }
    assert!(!has(seen, "/map/scene", "node 0000000a.10") && !has(seen, "/map/scene", "place dock"), "{seen}");
    assert_eq!(seen["scenes"]["/robots/scene"], json!(["robot amr-8", "robot tug-1"]));
    assert_eq!(numbers(&seen["frames"]["tug-1/base_link"]), [3.0, 0.5]);
    assert_eq!(numbers(&seen["poses"]["/robots/poses"]), [3.0, 0.5], "who knows where it is");
    let path = numbers(&seen["poses"]["/path"]);
    assert!(path.len() >= 4 && path.ends_with(&[9.0, 0.0]), "{path:?}");
    let grid = &seen["grid"];
    assert!(grid["free"].as_u64() > Some(1000) && grid["columns"].as_u64() > Some(100), "{grid}");
}

/// Robots come, move, do not know where they are, and go; the tokens of those that stay.
async fn robots_come_and_go(site: &Site, viewer: &Viewer) -> [LivelinessToken; 2] {
    let at = |robot: &str, x: f64| {
        let state = "LOCALIZED";
        json!({ "robot": robot, "localized": true, "state": state, "confidence": 0.97, "map_from_base": [x, 0.5, 0.0] })
    };
    let lost = json!({
        "robot": "amr-8", "localized": false, "state": "CANDIDATES", "confidence": 0.6,
        "candidates": [[1.0, 0.0, 0.0], [5.0, 0.0, 3.1]],
    });
    // Robots whose tokens are there stay however slow this machine is.
    let token = |robot: &str| site.session.liveliness().declare_token(format!("fht/museum/robots/{robot}"));
    let tokens = [token("tug-1").await.unwrap(), token("amr-8").await.unwrap()];
    let token = token("amr-7").await.unwrap();
    site.say("amr-7", &at("amr-7", 1.0)).await;
    viewer.sees("a robot", |seen| has(seen, "/robots/scene", "robot amr-7")).await;
    token.undeclare().await.unwrap();
    viewer.sees("that it has gone", |seen| seen["scenes"]["/robots/scene"] == json!([])).await;
    for x in [2.0, 2.5, 3.0] {
        site.say("tug-1", &at("tug-1", x)).await;
    }
    site.say("amr-8", &lost).await;
    site.say("evil", &json!("<script>")).await;
    viewer
        .sees("the others", |seen| count(seen, "/robots/scene") == 2 && seen["frames"]["tug-1/base_link"][0] == 3.0)
        .await;
    tokens
}

/// What other people's MCAP reader finds in a file.
fn recorded(record: &Path) -> Value {
    let wanted = ["mcap==1.6.0", "mcap-protobuf-support==0.6.0"];
    let python = packages::environment(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("mcap"), &wanted).join("python");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/viewer/read.py");
    let read = packages::run(Command::new(python).arg(script).arg(record)).stdout;
    serde_json::from_slice(&read).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn foxgloves_own_client_sees_the_map_and_asks_for_a_path() {
    let mut site = Site::with(20).await;
    let record = site.dir.path().join("run.mcap");
    let mut bridge = site.bridge(&["--record", record.to_str().unwrap()]);
    let viewer = Viewer::of(&bridge.url, "foxglove.sdk.v1");
    let services = json!(["/path", "/places"]);
    let seen = viewer.sees("what the bridge has", |seen| seen["services"] == services).await;
    assert_eq!(
        (seen["info"]["name"].as_str(), seen["channels"].as_object().map(serde_json::Map::len)),
        (Some("museum"), Some(6))
    );

    viewer.subscribe(&TOPICS);
    let seen = viewer.sees("the map", |seen| count(seen, "/map/scene") == 20 + 19).await;
    let whole = seen["bytes"]["/map/scene"].as_u64().unwrap();
    let before = |seen: &Value| seen["bytes"]["/map/scene"].as_u64().unwrap();

    // A node more is told alone.
    site.write(drive(20)).await;
    let seen = viewer.sees("the new node", |seen| has(seen, "/map/scene", "node 0000000a.20")).await;
    let delta = before(&seen) - whole;
    assert!(delta < whole / 5, "{delta} of {whole} bytes");
    println!("a map of 20 nodes: {whole} bytes; a node with its edge more: {delta} bytes");

    // What goes is deleted.
    site.write(vec![Op::SetPlace { name: "dock".parse().unwrap(), pose: Some(FixedPose::default()) }]).await;
    viewer.sees("the place", |seen| has(seen, "/map/scene", "place dock")).await;
    site.write(vec![Op::SetPlace { name: "dock".parse().unwrap(), pose: None }, Op::RemoveNode { id: node(10) }]).await;
    site.write(annotations()).await;
    viewer.sees("what is gone", |seen| count(seen, "/map/scene") == 40).await;

    let _tokens = robots_come_and_go(&site, &viewer).await;

    // Paths and places.
    let asked = viewer.call("/path", &json!({ "from": "6,0", "to": "15,0" }));
    assert!(asked["failure"].as_str().is_some_and(|reason| !reason.is_empty()), "a hole is on the way: {asked}");
    let answer = viewer.call("/path", &json!({ "from": "6,0", "to": "Küche" }));
    // It bends around what a scan took for a wall.
    let length_m = answer["reply"]["length_m"].as_f64();
    assert!(length_m.is_some_and(|length_m| (3.0..3.2).contains(&length_m)), "{answer}");
    let places = viewer.call("/places", &json!({}));
    assert!(places["reply"].to_string().contains("Küche"), "{places}");
    let wrong = viewer.call("/path", &json!({ "from": "0,0", "to": "dock;release=x" }));
    assert!(wrong["failure"].is_string(), "{wrong}");

    let all = |seen: &Value| seen["poses"]["/path"].is_array() && seen["grid"]["free"].as_u64() > Some(1000);
    let seen = viewer.sees("the path and the floor", all).await;
    check(&seen);
    assert_eq!(seen["statuses"], json!([]));

    // Who comes later sees the same, in the older protocol, too.
    let later = Viewer::of(&bridge.url, "foxglove.websocket.v1");
    later.sees("the greeting", |seen| seen["services"] == services).await;
    later.subscribe(&["/map/scene"]);
    let other = later.sees("the map", |seen| count(seen, "/map/scene") == 40).await;
    assert_eq!(other["scenes"]["/map/scene"], seen["scenes"]["/map/scene"]);
    assert_eq!(other["scenes"]["/robots/scene"], Value::Null, "it did not want that");
    later.ask(&json!({ "order": "unsubscribe", "topic": "/map/scene" }));
    later.subscribe(&["/robots/scene"]);
    later.sees("the robots", |seen| count(seen, "/robots/scene") == 2).await;

    // The recording shows the same.
    assert!(bridge.terminate().success());
    let read = recorded(&record);
    check(&read);
    assert_eq!(read["scenes"], seen["scenes"]);
    site.end().await;
}
