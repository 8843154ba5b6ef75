//! A person with nothing but `pip install zenoh-cli` asks a running server: a path is printed, and
//! a bad request prints the reason.

use crate::programs::executable;
use fht_demo::{Process, free_endpoint};
use fht_proto::api::reply::PathReply;
use fht_session::SessionConfig;
use fht_tests::corridors::{corridors, put};
use fht_tests::packages::{run, zenoh_cli};
use std::process::Command;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(30);

#[test]
fn a_path_is_printed_and_a_bad_request_prints_the_reason() {
    let zenoh = zenoh_cli(env!("CARGO_TARGET_TMPDIR"));
    let folder = tempfile::tempdir().unwrap();
    let endpoint = free_endpoint().unwrap();
    let _server = Process::map_server(executable(), folder.path(), &endpoint, PATIENCE).unwrap();

    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let session =
        runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None))).unwrap();
    put(&session, &"museum".parse().unwrap(), &corridors());

    let get = |selector: &str, decoder: &[&str]| {
        let mut command = Command::new(&zenoh);
        let output = run(command.args(["--connect", &endpoint, "get", "-s", selector]).args(decoder));
        (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let json = ["--decoder", "json"];

    let (path, said) = get("fht/museum/path?from=0,0;to=5,3", &json);
    let reply: PathReply = serde_json::from_str(&path).unwrap_or_else(|error| panic!("{error}: {path:?} {said:?}"));
    // Around the corner of the two corridors, a little shorter than through their nodes.
    let ends = [0, reply.waypoints.len() - 1].map(|index| (reply.waypoints[index].x, reply.waypoints[index].y));
    assert_eq!(ends, [(0.0, 0.0), (5.0, 3.0)]);
    assert!(reply.length_m > 7.0 && reply.length_m < 8.0, "{}", reply.length_m);
    let (maps, _) = get("fht/maps", &json);
    assert!(maps.contains("\"museum\""), "{maps}");

    for (selector, code, reason) in [
        ("fht/museum/path?from=0,0", "BAD_REQUEST", "parameter to is missing"),
        ("fht/museum/path?from=0,0;to=upstairs", "UNKNOWN_PLACE", "map museum has no place called upstairs"),
        ("fht/museum/path?from=0,0;to=1,x", "BAD_REQUEST", "1,x is not a place"),
        ("fht/museum/path?from=0,0;to=99,99", "OUT_OF_MAP", "is not on the map"),
        ("fht/louvre/path?from=0,0;to=5,3", "UNKNOWN_MAP", "there is no map louvre"),
        ("fht/museum/route?from=0,0;to=5,3", "BAD_REQUEST", "TOPIC one of head"),
    ] {
        let (printed, said) = get(selector, &json);
        assert!(printed.is_empty(), "{selector}: {printed}");
        // On standard error, with the reply's bytes as Python writes them: texts without quotes and
        // backslashes stay as they are.
        assert!(said.contains(code) && said.contains(reason) && !said.contains('\\'), "{selector}: {said}");
    }
}
