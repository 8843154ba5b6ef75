//! A person with nothing but `pip install zenoh-cli` asks a running server: a path is printed, and a bad request prints the
//! reason.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_link::LinkConfig;
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{Head, PathReply};
use fht_proto::{AuthorId, EdgeKey, FixedPose, Increment, MapName, NodeId, NodeKind, Op, Rect, encode};
use fht_tests::process::{Process, Role, free_endpoint};
use fht_tests::python::{environment, run};
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use zenoh::{Session, Wait};

const PATIENCE: Duration = Duration::from_secs(30);
const PACKAGE: &str = "zenoh-cli==0.7.0";

/// An L of two corridors: nodes at (0, 0), (5, 0) and (5, 3).
fn corridors() -> Vec<Increment> {
    let author = AuthorId::of_robot("explorer");
    let id = |number: u32| NodeId { author, number };
    let node = |number: u32, x: f64, y: f64| {
        let pose = FixedPose::from_metres(x, y, 0.0);
        let rect = Rect::around(pose.position, (x - 1.0, y - 1.0), (x + 1.0, y + 1.0));
        [
            Op::PutNode { id: id(number), kind: NodeKind::Support, pose },
            Op::SetFreeSpace { id: id(number), rect: Some(rect) },
        ]
    };
    let join = |a: u32, b: u32| Op::PutEdge { edge: EdgeKey::new(id(a), id(b)) };
    let first = [node(0, 0.0, 0.0), node(1, 5.0, 0.0)].concat();
    let second = [node(2, 5.0, 3.0).to_vec(), vec![join(0, 1), join(1, 2)]].concat();
    (1..).zip([first, second]).map(|(number, ops)| Increment { author, number, hlc_us: number, ops }).collect()
}

fn put(session: &Session, map: &MapName, increments: &[Increment]) {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        // Again until acknowledged: a server that listens may not have subscribed yet.
        for increment in increments {
            let key = Key::increment(map, increment.author, increment.number).to_string();
            session.put(key, encode(increment).unwrap()).wait().unwrap();
        }
        let replies = session.get(Key::topic(map, Topic::Head).to_string()).wait().unwrap();
        for reply in replies {
            let head =
                reply.result().ok().map(|sample| serde_json::from_slice::<Head>(&sample.payload().to_bytes()).unwrap());
            if head.is_some_and(|head| head.version == increments.len() as u64) {
                return;
            }
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("the increments were not acknowledged");
}

#[test]
fn a_path_is_printed_and_a_bad_request_prints_the_reason() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("zenoh-cli");
    let zenoh = environment(&folder, &[PACKAGE]).join("zenoh");
    let folder = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint().unwrap();
    let args = ["--data".as_ref(), folder.path().as_os_str(), "--listen".as_ref(), endpoint.as_ref()];
    let mut server = Process::start(Path::new(env!("CARGO_BIN_EXE_handoff")), Role::MapServer, args).unwrap();
    server.wait_until_listening(&endpoint, PATIENCE).unwrap();

    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let session = runtime.block_on(fht_link::open(&LinkConfig::from_options(vec![endpoint.clone()], None))).unwrap();
    put(&session, &"museum".parse().unwrap(), &corridors());

    let get = |selector: &str, decoder: &[&str]| {
        let mut command = Command::new(&zenoh);
        let output = run(command.args(["--connect", &endpoint, "get", "-s", selector]).args(decoder));
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let json = ["--decoder", "json"];

    let (path, said) = get("fht/museum/path?from=0,0;to=5,3", &json);
    let reply: PathReply = serde_json::from_str(&path).unwrap_or_else(|error| panic!("{error}: {path:?} {said:?}"));
    // Around the corner that the two corridors make, a little shorter than through their nodes.
    let ends = [0, reply.waypoints.len() - 1].map(|index| (reply.waypoints[index].x, reply.waypoints[index].y));
    assert_eq!(ends, [(0.0, 0.0), (5.0, 3.0)]);
    assert!(reply.length_m > 7.0 && reply.length_m < 8.0, "{}", reply.length_m);
    let (maps, _) = get("fht/maps", &json);
    assert!(maps.contains("\"museum\""), "{maps}");

    for (selector, code, reason) in [
        ("fht/museum/path?from=0,0", "BAD_REQUEST", "parameter to is missing"),
        ("fht/museum/path?from=0,0;to=upstairs", "UNKNOWN_PLACE", "there is no place upstairs"),
        ("fht/museum/path?from=0,0;to=1,x", "BAD_REQUEST", "1,x is not a place"),
        ("fht/museum/path?from=0,0;to=99,99", "OUT_OF_MAP", "is not on the map"),
        ("fht/louvre/path?from=0,0;to=5,3", "UNKNOWN_MAP", "there is no map louvre"),
        ("fht/museum/route?from=0,0;to=5,3", "BAD_REQUEST", "TOPIC one of head"),
    ] {
        let (printed, said) = get(selector, &json);
        assert!(printed.is_empty(), "{selector}: {printed}");
        // In the standard error, with the reply's bytes as Python writes them: texts without quotes and backslashes stay
        // as they are.
        assert!(said.contains(code) && said.contains(reason) && !said.contains('\\'), "{selector}: {said}");
    }
}
