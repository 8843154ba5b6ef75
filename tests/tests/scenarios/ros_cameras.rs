//! A ROS robot with four cameras: the explorer's main nodes have descriptors, another robot finds
//! its place by its pictures on another day, and `mapper ros check` names the cameras.

use crate::programs::{executable, start};
use fht_client::{LiveReplica, ReplicaConfig};
use fht_demo::{Process, Role, free_endpoint};
use fht_session::SessionConfig;
use serde_json::Value;
use std::process::Command;
use std::time::{Duration, Instant};

/// A busy machine takes its time: the robot waits for its commands.
const PATIENCE: Duration = Duration::from_secs(900);

/// A simulated robot with cameras, at a router of its own.
struct Robot {
    graph: String,
    _processes: [Process; 2],
}

impl Robot {
    fn new(more: &[&str]) -> Self {
        let graph = free_endpoint().unwrap();
        let mut router = start(Role::Sim, ["router", "--listen", &graph]);
        router.wait_until_listening(&graph, PATIENCE).unwrap();
        let robot = start(Role::Sim, [&["robot", "--ros", &graph, "--in-step=1", "--quiet"], more].concat());
        Self { graph, _processes: [router, robot] }
    }

    /// What a check says, once the robot is there and has sent pictures.
    fn checked(&self) -> String {
        let began = Instant::now();
        loop {
            let mut check = Command::new(executable());
            check.args(["role", Role::Mapper.name(), "--", "ros", "check", &self.graph, "--wait", "2"]);
            let output = check.output().unwrap();
            let said = String::from_utf8(output.stdout).unwrap();
            if output.status.success() && !said.contains(" 0 with pictures") {
                return said;
            }
            assert!(began.elapsed() < PATIENCE, "{said}");
        }
    }
}

fn count(report: &Value, key: &str) -> u64 {
    report[key].as_u64().unwrap_or_else(|| panic!("no {key}: {report}"))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn places_are_known_by_pictures_of_ros_robots() {
    let folder = tempfile::tempdir().unwrap();
    let maps = free_endpoint().unwrap();
    let _server = Process::map_server(executable(), folder.path(), &maps, PATIENCE).unwrap();
    let first = Robot::new(&["--cameras", "jpeg"]);
    let said = first.checked();
    for camera in ["front", "left", "back", "right"] {
        let good = format!("good      /camera_{camera}/image/compressed: /sim_robot publishes it");
        assert!(said.contains(&good), "{said}");
    }

    let link = ["--map", "lab", "--connect", &maps, "--json", "--quiet"];
    let explored = start(Role::Mapper, [&["explore", "--ros", &first.graph][..], &link].concat());
    let explored: Value = serde_json::from_str(&explored.finish(PATIENCE).unwrap()).unwrap();
    // A picture a second, a scan five times as often.
    let (frames, panoramas) = (count(&explored, "frames"), count(&explored, "panoramas"));
    assert!(panoramas * 6 > frames && panoramas < frames, "{explored}");
    let session = fht_session::open(&SessionConfig::from_options(vec![maps.clone()], None)).await.unwrap();
    let map = "lab".parse().unwrap();
    let copy = LiveReplica::start(&session, &map, "test", ReplicaConfig::default()).unwrap();
    let described = || {
        let map = copy.running();
        let of = map.main_nodes().filter(|node| node.signature.is_some_and(|it| it.descriptor.is_some())).count();
        (map.counts().main_nodes, of)
    };
    let began = Instant::now();
    while described().0 < 10 {
        assert!(began.elapsed() < PATIENCE, "{:?}", described());
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let (main_nodes, of) = described();
    assert_eq!(main_nodes, of, "each main node has a descriptor");

    let second = Robot::new(&["--cameras", "raw", "--light-seed", "1", "--anywhere", "--seed", "3"]);
    // Cameras that come later are not seen.
    second.checked();
    let found = start(Role::ClientRobot, [&["relocalize", "--ros", &second.graph][..], &link].concat());
    let found: Value = serde_json::from_str(&found.finish(PATIENCE).unwrap()).unwrap();
    assert_eq!(found["localized_at_end"], true, "{found}");
    assert!(count(&found, "panoramas") > 0, "{found}");
}
