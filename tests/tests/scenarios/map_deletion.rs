//! A map is deleted while it is explored: the explorer ends with the operator's reason, a robot
//! that comes meanwhile is warned, and another exploration may begin a map of the same name.

use crate::programs::{executable, start};
use fht_client::{AskError, ask_head};
use fht_demo::{Process, ProcessError, Role, free_endpoint};
use fht_proto::MapName;
use fht_proto::api::reply::{ErrorCode, Head};
use fht_session::SessionConfig;
use serde_json::Value;
use std::time::{Duration, Instant};
use zenoh::Session;

const PATIENCE: Duration = Duration::from_secs(60);
/// The map is deleted when so many increments are acknowledged.
const DELETE_AT: u64 = 10;
const REASON: &str = "mistyped: it is musee";

fn museum() -> MapName {
    "museum".parse().unwrap()
}

/// Runs an operator's command.
fn operate(endpoint: &str, args: &[&str]) -> Value {
    let printed = start(Role::MapServer, [args, &["--connect", endpoint, "--json"]].concat()).finish(PATIENCE);
    serde_json::from_str(&printed.unwrap()).unwrap()
}

fn said(ended: Result<(), ProcessError>) -> String {
    match ended {
        Err(ProcessError::Failed { stderr, .. }) => stderr,
        other => panic!("it should have failed: {other:?}"),
    }
}

/// Explores until `DELETE_AT` increments are acknowledged, calls `then`, and returns what the
/// explorer said at its end.
fn explore_until(endpoint: &str, then: impl FnOnce()) -> String {
    let args = ["explore", "--world", "museum", "--map", "museum", "--no-cameras", "--rate", "20", "--progress-json"];
    let explorer = start(Role::Mapper, [&args[..], &["--connect", endpoint]].concat());
    let mut then = Some(then);
    said(explorer.follow(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        if line["acknowledged"].as_u64().unwrap() >= DELETE_AT
            && let Some(then) = then.take()
        {
            then();
        }
    }))
}

fn head(session: &Session) -> Result<Head, AskError> {
    ask_head(session, &museum(), Duration::from_secs(5))
}

#[test]
fn a_map_is_deleted_while_it_is_explored() {
    let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
    let data = folder.path().join("data");
    let _server = Process::map_server(executable(), &data, &endpoint, PATIENCE).unwrap();
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let link = SessionConfig::from_options(vec![endpoint.clone()], None);
    let session = runtime.block_on(fht_session::open(&link)).unwrap();

    // With a grace period: the explorer ends, and what it has made is there.
    let delete = ["delete", "museum", "--reason", REASON, "--grace"];
    let told = explore_until(&endpoint, || _ = operate(&endpoint, &[&delete[..], &["1h"]].concat()));
    assert!(told.contains("map museum will be deleted at") && told.contains(REASON), "{told}");
    let kept = head(&session).unwrap();
    assert!(kept.version >= DELETE_AT && kept.deletion.is_some(), "{kept:?}");
    // Another one does not even begin.
    let args = ["explore", "--world", "museum", "--no-cameras", "--robot", "second", "--connect", &endpoint];
    let told = said(start(Role::Mapper, args).finish(PATIENCE).map(|_| ()));
    assert!(told.contains("map museum will be deleted at") && told.contains(REASON), "{told}");
    // A robot that uses the map is warned, once.
    let args = ["go", "--world", "museum", "--map", "museum", "--no-cameras", "--to", "1.5,0", "--max-sim", "5"];
    let told =
        said(start(Role::ClientRobot, [&args[..], &["--connect", &endpoint]].concat()).finish(PATIENCE).map(|_| ()));
    assert_eq!(told.matches("map museum will be deleted at").count(), 1, "{told}");

    // An operator is told once, and what follows from it.
    let place = ["place", "museum", "dock", "0,0", "--connect", &endpoint];
    let told = said(start(Role::MapServer, place).finish(PATIENCE).map(|_| ()));
    assert_eq!(told.matches("map museum will be deleted at").count(), 1, "{told}");
    assert!(told.contains("nothing is written") && told.contains("map-server undelete museum"), "{told}");

    // At once: the explorer that goes on is told, and does not begin the map anew.
    operate(&endpoint, &["undelete", "museum"]);
    operate(&endpoint, &[&delete[..], &["0s"]].concat());
    let told = explore_until(&endpoint, || _ = operate(&endpoint, &[&delete[..], &["0s"]].concat()));
    assert!(told.contains("map museum was deleted at") && told.contains(REASON), "{told}");
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(2) {
        match head(&session) {
            Err(AskError::Refused(reply)) if reply.code == ErrorCode::UnknownMap => {}
            other => panic!("the map is there again: {other:?}"),
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    // Another exploration begins it.
    let told = explore_until(&endpoint, || _ = operate(&endpoint, &[&delete[..], &["1h"]].concat()));
    assert!(told.contains("will be deleted at"), "{told}");
    assert!(head(&session).unwrap().version >= DELETE_AT);
}
