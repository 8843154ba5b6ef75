//! A server process with the page for operators: over HTTP the same is answered as over Zenoh, what
//! an operator changes there is seen by everybody, and the Zenoh side is not harmed by it.

use crate::support::{ANA, Server, ask, bytes, client, free_endpoint, head_when, key, until_up};
use fht_proto::api::fleet::{LocalizationState, RobotPose};
use fht_proto::api::reply::{Head, RulesReply};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::Command;
use std::time::{Duration, Instant};
use zenoh::Session;

const PATIENCE: Duration = Duration::from_secs(20);

/// A server process with the page, a session with it, and twelve nodes along the x axis.
struct Paged {
    session: Session,
    address: SocketAddr,
    _dir: tempfile::TempDir,
    _server: Server,
}

impl Paged {
    async fn start(more: &[&str]) -> Self {
        let (dir, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint());
        let address = fht_reserved_port::reserve().unwrap();
        let text = address.to_string();
        let args = [&["--web", text.as_str()], more].concat();
        let server = Server::with(&dir.path().join("data"), &endpoint, &args, &dir.path().join("log"));
        let session = client(&endpoint).await;
        until_up(&session).await;
        let paged = Self { session, address, _dir: dir, _server: server };
        paged.drive(1, 12).await;
        paged
    }

    async fn drive(&self, from: u64, to: u64) {
        for number in from..=to {
            self.session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
        }
        head_when(&self.session, |head| head.vector.get(ANA) == to).await;
    }

    fn send(&self, request: &str) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        // One that is closed at once shows when it is read.
        let _ = stream.write_all(request.as_bytes());
        stream
    }

    /// Status and body; none if the connection is closed before.
    fn try_exchange(&self, request: &str) -> Option<(u16, Vec<u8>)> {
        let mut reply = Vec::new();
        let _ = self.send(request).read_to_end(&mut reply);
        let at = reply.windows(4).position(|four| four == b"\r\n\r\n")?;
        let head = String::from_utf8_lossy(&reply[..at]).into_owned();
        Some((head.split(' ').nth(1)?.parse().ok()?, reply[at + 4..].to_vec()))
    }

    fn exchange(&self, request: &str) -> (u16, Vec<u8>) {
        self.try_exchange(request).unwrap()
    }

    fn try_get(&self, path: &str) -> Option<(u16, Vec<u8>)> {
        self.try_exchange(&format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"))
    }

    fn get(&self, path: &str) -> (u16, Vec<u8>) {
        self.try_get(path).unwrap()
    }

    fn change(&self, body: &str) -> (u16, Value) {
        self.post("change", body)
    }

    fn post(&self, what: &str, body: &str) -> (u16, Value) {
        let (status, body) = self.exchange(&format!(
            "POST /api/{what}/museum HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: \
             application/json\r\nContent-Length: {}\r\n\r\n{body}",
            body.len()
        ));
        (status, serde_json::from_slice(&body).unwrap_or_default())
    }

    async fn rules(&self) -> RulesReply {
        serde_json::from_slice(&ask(&self.session, "fht/museum/rules").await.remove(0).unwrap()).unwrap()
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn replies_are_those_of_zenoh() {
    let site = Paged::start(&["--web-operator", "ada"]).await;
    assert_eq!(site.change(r#"{"op":"put_release","name":"spring"}"#).0, 200);
    for selector in [
        "fht/maps",
        "fht/museum/head",
        "fht/museum/nodes?near=0,0;radius=100;limit=5",
        "fht/museum/nodes?near=0,0;fmt=postcard",
        "fht/museum/path?from=0,0;to=9,0",
        "fht/museum/path?from=0,0;to=9,0;fmt=postcard",
        "fht/museum/path?from=0,0;to=9,0;release=spring",
        "fht/museum/since",
        "fht/museum/since?fmt=json",
        "fht/museum/snapshot?version=3;fmt=json",
        "fht/museum/releases",
        "fht/museum/diff?from=3",
        "fht/museum/rules",
        "fht/museum/fleet",
        "fht/museum/journal?limit=1",
        "fht/museum/path?from=0,0;to=dock",
        "fht/museum/path?from=0,0",
        "fht/louvre/head",
        "fht/museum/diff?from=99",
    ] {
        let zenohs = ask(&site.session, selector).await.remove(0);
        let (status, body) = site.get(&format!("/{selector}"));
        match zenohs {
            Ok(bytes) => assert!(status == 200 && body == bytes, "{selector}: {status}"),
            Err(refusal) => {
                assert!((400..500).contains(&status), "{selector}: {status}");
                assert_eq!(body, serde_json::to_vec(&refusal).unwrap(), "{selector}");
            }
        }
    }
    let (status, walls) = site.get("/api/walls/museum?near=0,0&radius=100");
    let walls: Value = serde_json::from_slice(&walls).unwrap();
    assert!(status == 200 && walls["points"].as_array().unwrap().len() > 100, "{walls}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_an_operator_changes_over_http_is_seen_over_zenoh() {
    let site = Paged::start(&["--web-operator", "ada"]).await;
    let author = fht_proto::AuthorId::of_robot("ada");
    let live = site.session.declare_subscriber("fht/museum/inc/**").await.unwrap();
    // An answer on this session says that the server knows of the subscriber, too.
    head_when(&site.session, |_| true).await;
    let done = |body: &str| {
        let (status, reply) = site.change(body);
        assert_eq!(status, 200, "{body}: {reply}");
        reply
    };
    done(r#"{"op":"set_place","name":"dock","pose":[9,0,1.5708]}"#);
    let increment = tokio::time::timeout(PATIENCE, live.recv_async()).await.unwrap().unwrap();
    assert_eq!(increment.key_expr().as_str(), format!("fht/museum/inc/{author}/1"), "in the operator's own name");
    done(r#"{"op":"set_zone","name":"wet","zone":{"rule":{"speed_limit":0.3},"corners":[[5,-2],[7,-2],[7,2],[5,2]]}}"#);
    done(r#"{"op":"set_closed","edge":["0000000a.5","0000000a.6"],"closed":true}"#);
    let rules = site.rules().await;
    // To 1e-4 rad.
    let quarter = (std::f64::consts::FRAC_PI_2 * 1e4).round() / 1e4;
    assert_eq!((rules.places[0].name.as_str(), rules.places[0].pose), ("dock", [9.0, 0.0, quarter]));
    assert_eq!((rules.zones.len(), rules.closed_edges.len()), (1, 1));
    let undone = done(r#"{"op":"undo"}"#);
    assert_eq!(undone["words"][0], "the edge 0000000a.5 0000000a.6 is open again");
    assert!(site.rules().await.closed_edges.is_empty());
    done(r#"{"op":"undo"}"#);
    let rules = site.rules().await;
    assert!(rules.closed_edges.len() == 1 && rules.zones.len() == 1, "the undo is taken back: {rules:?}");

    let before = head_when(&site.session, |_| true).await.version;
    done(r#"{"op":"set_place","name":"dock","pose":[9,0,1.5708]}"#);
    assert_eq!(head_when(&site.session, |_| true).await.version, before, "what changes nothing is not written");
    done(r#"{"op":"put_release","name":"spring"}"#);
    done(r#"{"op":"enable","release":"spring"}"#);
    let head: Head = head_when(&site.session, |head| head.enabled.is_some()).await;
    assert_eq!(head.enabled, Some(format!("spring@{author}")));

    done(r#"{"op":"remove_nodes","nodes":["0000000a.11"]}"#);
    let (status, journal) = site.get("/fht/museum/journal?limit=2");
    let journal: Value = serde_json::from_slice(&journal).unwrap();
    let told = |of: usize| (journal["entries"][of]["name"].as_str(), journal["entries"][of]["words"][0].as_str());
    assert_eq!((status, told(0)), (200, (Some("ada"), Some("1 node is taken away"))), "{journal}");
    assert!(told(1).1.is_some_and(|words| words.starts_with("robots use release spring@")), "{journal}");
    let head: Head = head_when(&site.session, |_| true).await;

    for (body, status, said) in [
        (r#"{"op":"set_place","name":"far","pose":[500,500,0]}"#, 400, "no robot can be at"),
        (r#"{"op":"set_place","name":"quay","pose":null}"#, 404, "no place called quay"),
        (r#"{"op":"set_closed","edge":["0000000a.1","0000000a.9"],"closed":true}"#, 404, "no edge joins"),
        (r#"{"op":"put_release","name":"spring"}"#, 409, "releases never change"),
        (r#"{"op":"enable","release":"autumn"}"#, 404, "autumn"),
        (r#"{"op":"undo","count":99}"#, 409, "cannot be taken back"),
    ] {
        let (got, reply) = site.change(body);
        assert!(got == status && reply["message"].as_str().unwrap().contains(said), "{body}: {got} {reply}");
    }
    assert_eq!(head_when(&site.session, |_| true).await.version, head.version);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn earlier_states_are_shown_and_changes_looked_at_in_advance() {
    let site = Paged::start(&["--web-operator", "ada"]).await;
    let past = |query: &str| {
        let (status, body) = site.get(&format!("/api/past/museum?{query}"));
        (status, serde_json::from_slice::<Value>(&body).unwrap())
    };
    let (status, third) = past("version=3");
    assert!(status == 200 && third["version"] == 3 && third["oldest"] == 0, "{third}");
    assert_eq!(third["nodes"].as_array().unwrap().len(), 3);
    assert_eq!((past("version=99").0, past("release=spring").0, past("").0), (404, 404, 400));

    assert_eq!(site.change(r#"{"op":"set_place","name":"dock","pose":[9,0,0]}"#).0, 200);
    assert_eq!(site.change(r#"{"op":"set_place","name":"gate","pose":[1,0,0]}"#).0, 200);
    let before = head_when(&site.session, |_| true).await.version;
    let zone = |y: f64| {
        let corners = format!("[[4,{}],[6,{}],[6,{y}],[4,{y}]]", -y, -y);
        format!(r#"{{"op":"set_zone","name":"wet","zone":{{"rule":"keep_out","corners":{corners}}}}}"#)
    };
    let (status, beside) = site.post("preview", &zone(0.5));
    let (_, across) = site.post("preview", &zone(1.5));
    assert!(status == 200 && beside["asked"] == 1, "{beside}");
    let longer = &beside["paths"][0];
    assert!(longer["after_m"].as_f64() > longer["before_m"].as_f64(), "it leads around: {beside}");
    let closed = &across["paths"][0];
    assert!(closed["after_m"].is_null() && closed["message"].is_string(), "there is none: {across}");
    let (_, elsewhere) =
        site.post("preview", r#"{"op":"set_closed","edge":["0000000a.10","0000000a.11"],"closed":true}"#);
    assert_eq!(elsewhere["paths"].as_array().map(Vec::len), Some(0));
    assert_eq!(head_when(&site.session, |_| true).await.version, before, "nothing is written");

    let erased = r#"{"op":"remove_nodes","nodes":["0000000a.10","0000000a.11"]}"#;
    assert_eq!((site.change(erased).0, site.change(erased).0), (200, 404));
    let (_, now) = past(&format!("version={}", before + 1));
    assert_eq!(now["nodes"].as_array().unwrap().len(), 10);
    assert_eq!(site.change(r#"{"op":"undo"}"#).0, 200);
    head_when(&site.session, |head| head.main_nodes + head.support_nodes == 12).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_robots_would_run_after_a_release_is_enabled_or_that_undone_is_looked_at_in_advance() {
    let site = Paged::start(&["--web-operator", "ada"]).await;
    let done = |body: &str| {
        let (status, reply) = site.change(body);
        assert_eq!(status, 200, "{body}: {reply}");
    };
    let previewed = |body: &str| {
        let (status, reply) = site.post("preview", body);
        assert_eq!(status, 200, "{body}: {reply}");
        reply
    };
    done(r#"{"op":"set_place","name":"dock","pose":[9,0,0]}"#);
    done(r#"{"op":"set_place","name":"gate","pose":[1,0,0]}"#);
    done(r#"{"op":"put_release","name":"spring"}"#);
    // The newest state has a gap; the release has none.
    done(r#"{"op":"remove_nodes","nodes":["0000000a.5"]}"#);
    let enable = r#"{"op":"enable","release":"spring"}"#;
    let opened = previewed(enable);
    let path = &opened["paths"][0];
    assert!(path["before_m"].is_null() && path["after_m"].as_f64().is_some_and(|m| m > 7.9), "{opened}");
    done(enable);
    let zone = r#"{"op":"set_zone","name":"wet","zone":{"rule":"keep_out","corners":[[4,-2],[6,-2],[6,2],[4,2]]}}"#;
    let closed = previewed(zone);
    assert!(closed["paths"][0]["before_m"].is_number() && closed["paths"][0]["after_m"].is_null(), "{closed}");
    for back in [r#"{"op":"undo"}"#, r#"{"op":"enable","release":null}"#] {
        let closed = previewed(back);
        assert!(closed["paths"][0]["before_m"].is_number() && closed["paths"][0]["after_m"].is_null(), "{closed}");
    }
    done(r#"{"op":"put_release","name":"autumn"}"#);
    let other = previewed(r#"{"op":"enable","release":"autumn"}"#);
    assert!(other["paths"][0]["after_m"].is_null(), "another release: {other}");
}

/// Reads a stream of events until there is one that is wanted; its data.
fn event(stream: &mut TcpStream, text: &mut String, name: &str, wanted: impl Fn(&Value) -> bool) -> Value {
    let begin = Instant::now();
    loop {
        while let Some(end) = text.find("\n\n") {
            let one: String = text.drain(..end + 2).collect();
            let data = one.lines().find_map(|line| line.strip_prefix("data: ")).unwrap_or("null");
            let data: Value = serde_json::from_str(data).unwrap();
            if one.contains(&format!("event: {name}\n")) && wanted(&data) {
                return data;
            }
        }
        assert!(begin.elapsed() < PATIENCE, "no {name}");
        let mut bytes = [0; 65536];
        let count = stream.read(&mut bytes).unwrap();
        text.push_str(&String::from_utf8_lossy(&bytes[..count]).replace("\r\n", "\n"));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn who_watches_sees_a_map_grow_and_robots_move() {
    let site = Paged::start(&["--web-operator", "ada"]).await;
    let mut stream = site.send("GET /api/events/museum HTTP/1.1\r\nHost: localhost\r\n\r\n");
    let mut text = String::new();
    event(&mut stream, &mut text, "head", |head| head["version"] == 12);
    site.drive(13, 13).await;
    let grown = event(&mut stream, &mut text, "grown", |_| true);
    assert_eq!((&grown["from"], &grown["version"], &grown["rules"]), (&12.into(), &13.into(), &false.into()));
    let ids: Vec<&str> = grown["nodes"].as_array().unwrap().iter().map(|node| node["id"].as_str().unwrap()).collect();
    assert_eq!(ids, ["0000000a.11", "0000000a.12"], "the new one, and its neighbour that has an edge more");
    let begin = Instant::now();
    assert_eq!(site.change(r#"{"op":"set_place","name":"dock","pose":[9,0,0]}"#).0, 200);
    let grown = event(&mut stream, &mut text, "grown", |grown| grown["rules"] == true);
    assert!(grown["nodes"].as_array().unwrap().is_empty() && begin.elapsed() < PATIENCE);

    let pose = RobotPose {
        robot: "amr-7".to_owned(),
        localized: true,
        state: LocalizationState::Localized,
        confidence: 0.9,
        candidates: Vec::new(),
        probabilities: Vec::new(),
        map_from_base: Some([1.0, 0.5, 0.0]),
        lost_because: None,
        stamp_us: None,
    };
    let put = async |robot: &str, bytes: Vec<u8>| {
        site.session.put(format!("fht/museum/robots/{robot}/pose"), bytes).await.unwrap();
    };
    put("liar", serde_json::to_vec(&pose).unwrap()).await;
    put("amr-7", b"{".to_vec()).await;
    put("amr-7", serde_json::to_vec(&pose).unwrap()).await;
    let moved = event(&mut stream, &mut text, "robots", |_| true);
    assert_eq!(moved["robots"].as_array().unwrap().len(), 1, "{moved}");
    assert_eq!(moved["robots"][0]["map_from_base"][1], 0.5);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_list_of_roles_goes_before_the_name_of_an_operator() {
    let dir = tempfile::tempdir().unwrap();
    let roles = dir.path().join("roles.json5");
    std::fs::write(&roles, "{explorers: ['ana'], operators: ['desk']}").unwrap();
    let endpoint = free_endpoint();
    for (operator, rights) in [("ada", "look"), ("ana", "look"), ("desk", "change")] {
        let address = fht_reserved_port::reserve().unwrap();
        let text = address.to_string();
        let args = ["--web", text.as_str(), "--web-operator", operator, "--roles", roles.to_str().unwrap()];
        let server = Server::with(&dir.path().join("data"), &endpoint, &args, &dir.path().join("log"));
        let session = client(&endpoint).await;
        until_up(&session).await;
        let dir = tempfile::tempdir().unwrap();
        let site = Paged { session, address, _dir: dir, _server: server };
        let me: Value = serde_json::from_slice(&site.get("/api/me").1).unwrap();
        assert_eq!(me["rights"], rights, "{operator}");
        let (status, reply) = site.change(r#"{"op":"undo"}"#);
        assert_eq!(status, if rights == "change" { 404 } else { 403 }, "{operator}: {reply}");
        site.session.close().await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn hundreds_who_watch_do_not_keep_zenoh_waiting() {
    let site = Paged::start(&[]).await;
    let asked = async || {
        let begin = Instant::now();
        assert!(ask(&site.session, "fht/museum/path?from=0,0;to=9,0").await.remove(0).is_ok());
        begin.elapsed()
    };
    let mut watching = Vec::new();
    for _ in 0..600 {
        // Those beyond the limit are closed at once.
        if let Ok(mut stream) = TcpStream::connect(site.address) {
            let _ = stream.write_all(b"GET /api/events/museum HTTP/1.1\r\nHost: localhost\r\n\r\n");
            watching.push(stream);
        }
    }
    for number in 13..=40 {
        site.session.put(key(ANA, number), bytes(ANA, number)).await.unwrap();
        assert!(asked().await < PATIENCE);
    }
    head_when(&site.session, |head| head.vector.get(ANA) == 40).await;
    drop(watching);
    let begin = Instant::now();
    while site.try_get("/metrics").is_none() && begin.elapsed() < PATIENCE {
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    let figures = String::from_utf8(site.get("/metrics").1).unwrap();
    let line = |start: &str| figures.lines().find(|line| line.starts_with(start)).unwrap_or_default().to_owned();
    assert_eq!(line("fht_map_version{"), "fht_map_version{map=\"museum\"} 40");
    assert!(!line("fht_queries_total{topic=\"path\",outcome=\"answered\"}").ends_with(" 0"), "{figures}");
    assert!(!line("fht_http_refused_connections_total").ends_with(" 0"), "{figures}");
}

#[test]
fn strangers_are_not_let_in_by_mistake() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    for (args, said) in [
        (&["--web", "0.0.0.0:8080"][..], "everybody who reaches this address would be let in"),
        (&["--web-operator", "ada"][..], "goes with --web"),
        (&["--web", "127.0.0.1:0", "--web-key", "a.key"][..], "--web-certificate"),
    ] {
        let run = Command::new(env!("CARGO_BIN_EXE_map-server"))
            .args(["--data", data.to_str().unwrap(), "--listen", &free_endpoint()])
            .args(args)
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.code() == Some(2) && text.contains(said), "{args:?}: {text}");
    }
    assert!(!data.exists(), "nothing was begun");
}
