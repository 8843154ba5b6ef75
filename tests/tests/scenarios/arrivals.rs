//! How a robot ends: at the heading of the place that it was sent to, with words and an exit code
//! that say what is true, and with its last pose and version known to everybody.

use crate::programs::{executable, run};
use fht_demo::{Process, Role, free_endpoint};
use fht_perception::pose::wrap_angle;
use fht_proto::api::fleet::RobotPose;
use fht_proto::api::keys::{Key, RobotTopic};
use fht_session::SessionConfig;
use serde_json::Value;
use std::process::Output;
use std::time::{Duration, Instant, SystemTime};
use zenoh::Wait;

/// How long a process may take.
const PATIENCE: Duration = Duration::from_secs(120);

fn said(output: &Output) -> (String, String) {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).into()
}

/// What the server says of a robot that has gone.
fn fleet_view(endpoint: &str, robot: &str) -> Value {
    let begin = Instant::now();
    loop {
        let output = run(Role::MapServer, &["robots", "museum", "--json", "--connect", endpoint]);
        let fleet: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let view =
            fleet["robots"].as_array().into_iter().flatten().find(|view| view["status"]["robot"] == robot).cloned();
        match view {
            Some(view) if view["alive"] == false => return view,
            _ => assert!(begin.elapsed() < PATIENCE, "{robot} is still there: {fleet}"),
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn robots_end_where_they_say_and_everybody_knows_where_that_is() {
    let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
    let programs = executable();
    let _server = Process::map_server(programs, &folder.path().join("data"), &endpoint, PATIENCE).unwrap();
    let link = ["--connect", endpoint.as_str()];

    // The first rooms of the museum; that the map is not complete is said by its exit code.
    let explore = ["explore", "--world", "museum", "--no-cameras", "--max-sim", "60", "--quiet"];
    let explored = run(Role::Mapper, &[&explore[..], &link].concat());
    assert!(said(&explored).1.contains("not complete: out of time"), "{explored:?}");
    let explorer = fleet_view(&endpoint, "explorer");
    assert_eq!(explorer["behind"], 0, "it has all that it made: {explorer}");

    for (place, at) in [("north", "1,0,90"), ("south", "1,0,-90")] {
        let named = run(Role::MapServer, &[&["place", "museum", place, at][..], &link].concat());
        assert!(named.status.success(), "{named:?}");
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let session =
        runtime.block_on(fht_session::open(&SessionConfig::from_options(vec![endpoint.clone()], None))).unwrap();
    let pose_key = Key::robot(&"museum".parse().unwrap(), "tug", RobotTopic::Pose).to_string();
    let poses = session.declare_subscriber(pose_key).wait().unwrap();
    let go = |to: &str, more: &[&str]| {
        let args = ["go", "--to", to, "--start", "0,0,2", "--no-camera", "--robot", "tug"];
        run(Role::ClientRobot, &[&args[..], &link, more].concat())
    };

    for (place, yaw_deg) in [("north", 90.0_f64), ("south", -90.0)] {
        let output = go(place, &["--json"]);
        let report: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"));
        assert!(output.status.success() && report["arrived"] == true, "{report}");
        assert!(report["goal_turn_deg"].as_f64().unwrap() < 3.0, "{place}: {report}");
        let robot = fleet_view(&endpoint, "tug");
        // The server has its last word, so it is here, too, or about to be.
        let mut last: Option<RobotPose> = None;
        while let Ok(Some(sample)) = poses.recv_timeout(Duration::from_secs(1)) {
            last = Some(serde_json::from_slice(&sample.payload().to_bytes()).unwrap());
        }
        let last = last.unwrap();
        let since = SystemTime::UNIX_EPOCH + Duration::from_micros(last.stamp_us.unwrap());
        assert!(since.elapsed().unwrap() < PATIENCE, "{last:?}");
        let [x, y, yaw] = last.map_from_base.unwrap();
        let left_deg = wrap_angle(yaw - yaw_deg.to_radians()).abs().to_degrees();
        println!("{place}: last word ({x:.2}, {y:.2}), {left_deg:.2} degrees from the heading");
        assert!((x - 1.0).hypot(y) < 0.15 && left_deg < 1.5, "{place}: ({x}, {y}, {yaw})");
        assert_eq!(robot["status"]["map_from_base"], serde_json::json!([x, y, yaw]));
    }

    // The truth lies elsewhere: the robot believes that it arrived, the simulator knows better.
    let astray = go("north", &["--map-origin", "3,3,0"]);
    let (words, why) = said(&astray);
    assert_eq!(astray.status.code(), Some(1), "{words}");
    assert!(!words.contains("arrived after") && why.contains("says that it arrived, but it stands"), "{words} {why}");
    let astray = run(
        Role::ClientRobot,
        &[&["relocalize", "--start", "0,0,2", "--no-camera", "--map-origin", "3,3,0"][..], &link].concat(),
    );
    assert!(astray.status.code() == Some(1) && said(&astray).1.contains("m and "), "{astray:?}");

    // Nowhere to go.
    let begin = Instant::now();
    let nowhere = go("500,500", &[]);
    assert_eq!(nowhere.status.code(), Some(2), "refused before it drives: {nowhere:?}");
    assert!(said(&nowhere).1.contains("is not on the map"), "{nowhere:?}");
    let quiet = go("500,500", &["--quiet"]);
    let (words, why) = said(&quiet);
    assert!(quiet.status.code() == Some(2) && words.is_empty() && why.contains("is not on the map"), "{quiet:?}");
    assert!(begin.elapsed() < Duration::from_secs(60));
}
