//! Actions with another project's ROS 2 stack, hiroz, both ways: its clients ask our planner for
//! paths and routes and send our robot, with feedback and results, and take a goal back; and it is
//! a Nav2 that our client drives by.

use crate::programs::{executable, start};
use fht_demo::{Process, Role, free_endpoint};
use fht_perception::pose::{Point2, pose};
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::msg::{CancelGoal, GoalStatusArray, GoalStatusMsg, PoseStamped};
use fht_ros_messages::nav2::{
    ComputePathToPose, ComputePathToPoseGoal, ComputeRoute, ComputeRouteGoal, NavigateToPose, NavigateToPoseGoal,
};
use fht_ros_messages::{Distribution, RosAction, RosMessage, RosService, type_hash};
use fht_tests::foreign_ros;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(180);
/// Between a goal that is refused and the next.
const AGAIN: Duration = Duration::from_millis(500);

/// The foreign node in a role, and what it prints.
struct Peer {
    child: Child,
    goals: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Peer {
    fn start(endpoint: &str, role: &str) -> Self {
        let parts = ["SendGoal", "GetResult", "FeedbackMessage"];
        let actions = [ComputePathToPose::TYPE, ComputeRoute::TYPE, NavigateToPose::TYPE];
        let of_actions = actions.iter().flat_map(|action| parts.iter().map(move |part| format!("{action}_{part}")));
        let names = of_actions.chain([CancelGoal::TYPE.to_owned(), GoalStatusArray::TYPE.to_owned()]);
        let hashes: BTreeMap<String, String> =
            names.map(|name| (name.clone(), type_hash(&name, Distribution::Jazzy).unwrap())).collect();
        let mut command = Command::new(foreign_ros::program("hiroz-peer"));
        command.args([endpoint, &serde_json::to_string(&hashes).unwrap(), role]);
        command.env_remove("ZENOH_CONFIG_OVERRIDE").env("RUST_LOG", "error");
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (goals, lines) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()).lines());
        let mut peer = Self { child, goals, lines };
        peer.line("ready");
        peer
    }

    /// The rest of the next line that begins like this.
    fn line(&mut self, beginning: &str) -> String {
        let found = self.lines.by_ref().map(Result::unwrap).find_map(|line| {
            println!("hiroz: {}", &line[..line.len().min(200)]);
            Some(line.strip_prefix(beginning)?.trim().to_owned())
        });
        found.unwrap_or_else(|| panic!("the peer has ended without a line that begins with {beginning}"))
    }

    fn send(&mut self, goal: &impl Serialize) {
        writeln!(self.goals, "{}", serde_json::to_string(goal).unwrap()).unwrap();
    }

    fn said(&mut self, beginning: &str) -> Value {
        serde_json::from_str(&self.line(beginning)).unwrap()
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn at(x: f64, y: f64, yaw: f64) -> PoseStamped {
    PoseStamped { header: header_message(1, "map"), pose: pose_message(&pose(x, y, yaw)) }
}

fn place(value: &Value) -> Point2 {
    Point2::new(value["x"].as_f64().unwrap(), value["y"].as_f64().unwrap())
}

/// A map of the museum at a server, and a robot's router.
struct Site {
    maps: String,
    graph: String,
    _processes: Vec<Process>,
    _folder: tempfile::TempDir,
}

impl Site {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (graph, maps) = (free_endpoint().unwrap(), free_endpoint().unwrap());
        let server = Process::map_server(executable(), folder.path(), &maps, PATIENCE).unwrap();
        let mapped = ["explore", "--no-cameras", "--connect", &maps, "--map", "lab", "--quiet"];
        start(Role::Mapper, mapped).finish(PATIENCE).unwrap();
        let mut router = start(Role::Sim, ["router", "--listen", &graph]);
        router.wait_until_listening(&graph, PATIENCE).unwrap();
        Self { maps, graph, _processes: vec![server, router], _folder: folder }
    }

    fn client(&self, task: &[&str]) -> Process {
        let link = ["--map", "lab", "--connect", &self.maps, "--ros", &self.graph];
        start(Role::ClientRobot, [&task[..1], &link, &task[1..]].concat())
    }
}

fn asks_our_planner(site: &Site) {
    let _planner = site.client(&["route"]);
    let mut paths = Peer::start(&site.graph, "path");
    let from_origin = ComputePathToPoseGoal {
        goal: at(5.0, 3.0, 1.5),
        start: at(0.0, 0.0, 0.0),
        use_start: true,
        ..Default::default()
    };
    paths.send(&from_origin);
    paths.line("feedback");
    let ended = paths.said("result ");
    assert_eq!(ended["status"], GoalStatusMsg::SUCCEEDED, "{ended}");
    let poses = ended["result"]["path"]["poses"].as_array().unwrap();
    let last = place(&poses.last().unwrap()["pose"]["position"]);
    assert!(poses.len() > 100 && (last - Point2::new(5.0, 3.0)).norm() < 0.01, "{last}");
    paths.send(&ComputePathToPoseGoal { goal: at(500.0, 3.0, 0.0), ..from_origin });
    let ended = paths.said("result ");
    assert_eq!((&ended["status"], &ended["result"]["error_code"]), (&6.into(), &204.into()), "{ended}");
    assert!(ended["result"]["error_msg"].as_str().unwrap().contains("not on the map"), "{ended}");

    let mut routes = Peer::start(&site.graph, "route");
    let goal = ComputeRouteGoal {
        goal: at(5.0, 3.0, 1.5),
        start: at(0.0, 0.0, 0.0),
        use_start: true,
        use_poses: true,
        ..Default::default()
    };
    routes.send(&goal);
    let ended = routes.said("result ");
    assert_eq!(ended["status"], GoalStatusMsg::SUCCEEDED, "{ended}");
    let (nodes, edges) = (&ended["result"]["route"]["nodes"], &ended["result"]["route"]["edges"]);
    let (nodes, edges) = (nodes.as_array().unwrap(), edges.as_array().unwrap());
    assert!(nodes.len() >= 2 && edges.len() + 1 == nodes.len(), "{ended}");
    for (edge, pair) in edges.iter().zip(nodes.windows(2)) {
        assert_eq!(
            (place(&edge["start"]), place(&edge["end"])),
            (place(&pair[0]["position"]), place(&pair[1]["position"]))
        );
    }
}

/// Sends a goal until the robot knows its place, and returns how it ended.
fn sent_until_taken(peer: &mut Peer, goal: &NavigateToPoseGoal, beginning: &str) -> Value {
    let began = Instant::now();
    loop {
        assert!(began.elapsed() < PATIENCE, "it never drives");
        peer.send(goal);
        let ended = peer.said(beginning);
        let reason = ended["result"]["error_msg"].as_str().unwrap_or_default();
        if !reason.contains("does not know where it is") {
            return ended;
        }
        std::thread::sleep(AGAIN);
    }
}

fn sends_our_robot(site: &Site) {
    let _robot = site.client(&["serve", "--robot", "tug"]);
    let goal = |x, y, yaw| NavigateToPoseGoal { pose: at(x, y, yaw), behavior_tree: String::new() };
    let mut going = Peer::start(&site.graph, "go");
    let ended = sent_until_taken(&mut going, &goal(1.0, 0.5, 0.0), "result ");
    assert_eq!((&ended["status"], &ended["result"]["error_code"]), (&4.into(), &0.into()), "{ended}");
    going.send(&goal(0.0, 0.0, 0.0));
    loop {
        let heard = going.said("feedback ");
        if heard["distance_remaining"].as_f64().unwrap() > 0.2 {
            assert_eq!(heard["current_pose"]["header"]["frame_id"], "map", "{heard}");
            break;
        }
    }
    assert_eq!(going.said("result ")["status"], GoalStatusMsg::SUCCEEDED);
    let mut changing_its_mind = Peer::start(&site.graph, "cancel");
    changing_its_mind.send(&goal(5.0, 3.0, 1.5));
    assert_eq!(changing_its_mind.line("cancelled "), "1");
    assert_eq!(changing_its_mind.said("result ")["status"], GoalStatusMsg::CANCELED);
}

fn drives_our_robot(site: &Site) {
    let mut nav2 = Peer::start(&site.graph, "nav2");
    // In sight: it plans nothing.
    let go = ["go", "--robot", "tug", "--to", "1.5,-3.5", "--json", "--drive", "nav2"];
    let report: Value = serde_json::from_str(&site.client(&go).finish(PATIENCE).unwrap()).unwrap();
    assert_eq!(report["arrived"], true, "{report}");
    let end = Point2::new(report["end"][0].as_f64().unwrap(), report["end"][1].as_f64().unwrap());
    assert!((end - Point2::new(1.5, -3.5)).norm() < 0.35, "{report}");
    assert!(!nav2.line("goal ").is_empty());
}

#[test]
fn actions_of_another_stack_ask_send_and_drive() {
    let site = Site::new();
    asks_our_planner(&site);
    let _robot = start(Role::Sim, ["robot", "--ros", &site.graph, "--rate", "2", "--quiet"]);
    sends_our_robot(&site);
    drives_our_robot(&site);
}
