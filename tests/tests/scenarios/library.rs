//! The examples of the library for integrators, run one after the other against a real server: a
//! map, a path, an author, a follower, a robot of one's own, a recorded drive.

#[path = "../../../crates/fht/examples/04_own_robot.rs"]
#[allow(dead_code, missing_docs)]
mod own_robot;

use crate::programs::executable;
use fht::{DriveError, Map, Robot, Sensors, Twist, pose};
use fht_bag::{FrameRecording, Recorder};
use fht_demo::{Process, Role, free_endpoint};
use own_robot::Toy;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// For whatever a process may take.
const PATIENCE: Duration = Duration::from_secs(40);

fn begin(executable: &str, args: &[&str]) -> Child {
    Command::new(executable).args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn finish(example: Child) -> String {
    let Output { status, stdout, stderr } = example.wait_with_output().unwrap();
    let (said, complaint) = (String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr));
    println!("{said}{complaint}");
    assert!(status.success(), "{status}: {said}{complaint}");
    said.into_owned()
}

fn run(executable: &str, args: &[&str]) -> String {
    finish(begin(executable, args))
}

/// A drive of the toy, written to a bag.
fn record(path: &Path) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let recorder = Recorder::start(path).unwrap();
    let mut frames = FrameRecording::default();
    let mut toy = Toy::at(pose(1.0, 2.4, -0.5));
    let mut taken = Vec::new();
    runtime.block_on(async {
        for step in 0..120 {
            taken.push(toy.sense().await.unwrap());
            let angular_radps = if step < 60 { 0.1 } else { -0.1 };
            toy.drive(Twist { linear_mps: 0.2, angular_radps }).await.unwrap();
        }
    });
    recorder.submit(move |bag| taken.iter().try_for_each(|frame| frames.write(bag, frame, None)));
    recorder.finish().unwrap();
}

/// The toy is sent to a place behind the wall: it stays where it is, and goes near if it may.
fn go_behind_the_wall(endpoint: &str) {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    runtime.block_on(async {
        let map = Map::connect(endpoint, "toy").robot("toy").await.unwrap();
        let mut toy = Toy::at(pose(1.5, 2.2, 2.0));
        let refused = map.go(&mut toy, (7.0, 6.5)).await;
        assert!(matches!(refused, Err(DriveError::Failed(_))), "{refused:?}");
        let arrived = map.go(&mut toy, (7.0, 6.5)).to_nearest().await.unwrap();
        let at = arrived.pose.translation;
        assert!((at.x - 7.0).abs() < 0.5 && (4.0..6.0).contains(&at.y), "{at:?}");
    });
}

#[test]
fn the_examples_of_the_library_run() {
    let (folder, endpoint) = (tempfile::tempdir().unwrap(), free_endpoint().unwrap());
    let programs = executable();
    let _server = Process::map_server(programs, &folder.path().join("data"), &endpoint, PATIENCE).unwrap();
    let endpoint = endpoint.as_str();

    let unknown = begin(env!("CARGO_BIN_EXE_library_01_path"), &[endpoint, "toy", "1,1", "7,4"]);
    let unknown = unknown.wait_with_output().unwrap();
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("there is no map toy here"), "{unknown:?}");

    let made = run(env!("CARGO_BIN_EXE_library_00_toy_room"), &[endpoint, "toy"]);
    assert!(made.contains("6 nodes, 7 edges"));

    // Robots run a release from now on; what is named later has its name there, too.
    for order in ["create", "enable"] {
        let args = ["release", order, "toy", "opening", "--connect", endpoint];
        Process::start(programs, Role::MapServer, args).unwrap().finish(PATIENCE).unwrap();
    }

    let path = run(env!("CARGO_BIN_EXE_library_01_path"), &[endpoint, "toy", "1,1", "7,4"]);
    assert!(path.contains("planned by the Server") && path.contains("7.000    4.000"));
    let nowhere = begin(env!("CARGO_BIN_EXE_library_01_path"), &[endpoint, "toy", "1,1", "canteen"]);
    let nowhere = nowhere.wait_with_output().unwrap();
    assert!(String::from_utf8_lossy(&nowhere.stderr).contains("map toy has no place called canteen"), "{nowhere:?}");

    let lost = begin(env!("CARGO_BIN_EXE_library_04_own_robot"), &[endpoint, "toy", "canteen"]);
    let lost = lost.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&lost.stderr).into_owned();
    assert_eq!(said.trim(), "the own copy of the map has no place called canteen (there is none)");

    let follower = begin(env!("CARGO_BIN_EXE_library_02_follow_a_map"), &[endpoint, "toy", "40"]);
    let written = run(env!("CARGO_BIN_EXE_library_05_write"), &[endpoint, "toy"]);
    assert!(written.contains("slowly on 1 parts") && written.contains(r#"places: ["dock"]"#));

    std::thread::sleep(Duration::from_secs(3)); // until what the writer found blocked is open again
    let driven = run(env!("CARGO_BIN_EXE_library_04_own_robot"), &[endpoint, "toy", "dock"]);
    let (x, y) = driven
        .split_once("the toy is at (")
        .and_then(|(_, rest)| rest.split_once(')'))
        .map(|(at, _)| at)
        .and_then(|at| at.split_once(", "))
        .unwrap();
    let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
    assert!((x - 7.0).hypot(y - 4.0) < 0.4, "({x}, {y})");
    let followed = finish(follower);
    for line in ["toy: 6 nodes, 7 edges", "dock at (7.00, 4.00)", "writer is here", "toy is here", "toy: LOCALIZED at"]
    {
        assert!(followed.contains(line), "{line}");
    }

    go_behind_the_wall(endpoint);

    let bag = folder.path().join("drive.mcap");
    record(&bag);
    let found = run(env!("CARGO_BIN_EXE_library_03_relocalize"), &[endpoint, "toy", bag.to_str().unwrap()]);
    assert!(found.contains("localized: x "));
}
