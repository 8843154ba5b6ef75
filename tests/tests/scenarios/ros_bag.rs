//! A recorded run that is played as a live ROS robot gives the map that its replay gives, to the
//! last bit, where no frame came late.

use crate::programs::start;
use fht_demo::{Process, ProcessError, Role, free_endpoint};
use serde_json::Value;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(120);

/// What a mapper reports.
fn mapped(args: &[&str]) -> Value {
    serde_json::from_str(&start(Role::Mapper, args).finish(PATIENCE).unwrap()).unwrap()
}

fn router() -> (Process, String) {
    let endpoint = free_endpoint().unwrap();
    let mut router = start(Role::Sim, ["router", "--listen", &endpoint]);
    router.wait_until_listening(&endpoint, PATIENCE).unwrap();
    (router, endpoint)
}

/// Plays the bag `rate` times as fast to a mapper that listens, and returns what it reports.
fn heard(bag: &str, rate: &str) -> Value {
    let (_router, endpoint) = router();
    let played = start(Role::Sim, ["play", bag, "--ros", &endpoint, "--rate", rate, "--wait-for-listener"]);
    let listening =
        ["explore", "--ros", &endpoint, "--drive", "others", "--end-after", "3", "--offline", "--json", "--quiet"];
    let report = mapped(&listening);
    let said = played.finish(PATIENCE).unwrap();
    assert_eq!(said.trim(), format!("played {} frames", report["scans"]), "{report}");
    report
}

#[test]
fn a_bag_that_is_played_gives_the_map_of_its_replay() {
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run.mcap");
    let bag = bag.to_str().unwrap();
    // A robot whose clock does not begin at 0, which to ROS is no time.
    let (_router, endpoint) = router();
    let _robot = start(Role::Sim, ["robot", "--ros", &endpoint, "--in-step"]);
    let driven = ["explore", "--ros", &endpoint, "--offline", "--record", bag, "--max-sim", "120", "--json", "--quiet"];
    let driven = start(Role::Mapper, driven);
    // Its time is over before the museum is.
    assert!(matches!(driven.finish(PATIENCE), Err(ProcessError::Failed { .. })));
    let replayed = mapped(&["replay", bag, "--offline", "--json", "--quiet"]);
    // Where the processors are busy, it is played slower.
    for rate in ["20", "10", "5"] {
        let report = heard(bag, rate);
        let count = |key: &str| report[key].as_u64().unwrap();
        println!(
            "{rate} times: {} frames, {} late, {} lost",
            count("frames"),
            count("frames_late"),
            count("frames_lost")
        );
        if count("frames_late") + count("frames_lost") == 0 {
            assert_eq!(report["digest"], replayed["digest"], "{report}\n{replayed}");
            assert_eq!(report["ending"], "complete", "{report}");
            return;
        }
    }
    panic!("frames were late even at five times the robot's pace");
}
