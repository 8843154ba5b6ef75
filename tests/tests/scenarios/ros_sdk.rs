//! A foreign ROS 2 peer, unmodified: PyPI's zenoh-ros2-sdk hears what our nodes publish (also what
//! was published before it came), is a robot that we sense with and drive, and asks and answers
//! services.

use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::grid::CellState;
use fht_perception::pose::{Point2, pose};
use fht_perception::robot::{Robot, Sensors, SilenceConfig, Supervised};
use fht_proto::api::fleet::LocalizationState;
use fht_ros::{NodeConfig, Qos, RosNode};
use fht_ros_frames::FloorGrid;
use fht_ros_messages::msg::{
    HeaderMsg, LaserScanMsg, MapMetaData, OccupancyGridMsg, OdometryMsg, PoseWithCovarianceStamped, SetBool,
    SetBoolRequest, SetBoolResponse, StringMsg, TfMessage, TwistMsg,
};
use fht_ros_messages::{Distribution, RosMessage, RosService, definition, type_hash};
use fht_ros_robot::{OutputRole, PlaceNow, RosOutputs, RosRobot, RosRobotConfig};
use fht_session::SessionConfig;
use fht_tests::packages::environment;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Lines, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};
use tokio::time::timeout;

const PATIENCE: Duration = Duration::from_secs(20);
const PACKAGES: [&str; 2] = ["zenoh-ros2-sdk==0.1.8", "eclipse-zenoh==1.10.2"];

/// The peer, and what it prints.
struct Peer {
    child: Child,
    commands: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Peer {
    fn start(port: u16, folder: &Path) -> Self {
        let venv = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ros-sdk");
        let python = environment(&venv, &PACKAGES).join("python");
        let types: BTreeMap<&str, [Option<String>; 2]> = [
            StringMsg::TYPE,
            OccupancyGridMsg::TYPE,
            TwistMsg::TYPE,
            LaserScanMsg::TYPE,
            OdometryMsg::TYPE,
            TfMessage::TYPE,
            PoseWithCovarianceStamped::TYPE,
            SetBool::TYPE,
        ]
        .into_iter()
        .map(|name| (name, [definition(name), type_hash(name, Distribution::Jazzy)]))
        .collect();
        let file = folder.join("types.json");
        std::fs::write(&file, serde_json::to_vec(&types).unwrap()).unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ros_sdk/peer.py");
        let mut command = Command::new(python);
        command.arg(script).arg(port.to_string()).arg(file).env_remove("ZENOH_CONFIG_OVERRIDE");
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (commands, lines) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()).lines());
        Self { child, commands, lines }
    }

    fn tell(&mut self, command: &str) {
        writeln!(self.commands, "{command}").unwrap();
    }

    /// The rest of the next line that begins like this.
    fn line(&mut self, beginning: &str) -> String {
        let found =
            self.lines.by_ref().map(Result::unwrap).find_map(|line| Some(line.strip_prefix(beginning)?.to_owned()));
        found.unwrap_or_else(|| panic!("the peer has ended without a line that begins with {beginning}"))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

async fn soon<T>(future: impl Future<Output = T>) -> T {
    timeout(PATIENCE, future).await.expect("it does not take that long")
}

/// A robot's router.
async fn router(port: u16) -> zenoh::Session {
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "'router'").unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("listen/endpoints", &format!("['tcp/127.0.0.1:{port}']")).unwrap();
    zenoh::open(config).await.unwrap()
}

async fn topics_and_services(node: &RosNode, peer: &mut Peer) {
    let chatter = node.publisher("chatter", Qos::default()).await.unwrap();
    soon(async {
        while !chatter.is_heard().await.unwrap() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    })
    .await;
    chatter.publish(&StringMsg { data: "hello, peer".to_owned() }).unwrap();
    assert_eq!(peer.line("chatter "), "hello, peer");

    let switch = node.client::<SetBool>("/switch").await.unwrap();
    let answer = switch.call(&SetBoolRequest { data: true }, PATIENCE).await.unwrap();
    assert_eq!(answer, SetBoolResponse { success: true, message: "it is done".to_owned() });

    let light = node.server::<SetBool>("light").await.unwrap();
    tokio::time::sleep(Duration::from_millis(300)).await;
    peer.tell("call");
    let call = soon(light.next()).await;
    assert!(call.request.data);
    call.respond(&SetBoolResponse { success: true, message: "on".to_owned() }).unwrap();
    assert_eq!(peer.line("light "), "True on");

    peer.tell("list");
    let topics = peer.line("topics ");
    assert!(topics.contains("('/chatter', ['std_msgs/msg/String'])") && topics.contains("/map"), "{topics}");
}

/// What a robot that knows its place tells its graph.
async fn the_peer_sees_where_the_robot_is(node: &RosNode, robot: &RosRobot, frame: &SensorFrame, peer: &mut Peer) {
    let outputs = RosOutputs::start(node, OutputRole::Localization, robot.odom_frame()).await.unwrap();
    let now = PlaceNow {
        time_us: frame.time_us,
        state: LocalizationState::Localized,
        confidence: 0.999,
        odom_from_base: frame.odom_from_base,
        map_from_base: Some(pose(4.0, 2.0, 0.5)),
        candidates: Vec::new(),
        lost_because: None,
    };
    let grid = FloorGrid {
        resolution_m: 0.05,
        origin: Point2::new(-1.0, 2.0),
        width: 2,
        cells: vec![CellState::Free, CellState::Occupied, CellState::Unknown, CellState::Free],
    };
    outputs.floor(frame.time_us, move || grid);
    let saying = tokio::spawn(async move {
        // Transforms are not kept for who comes later.
        loop {
            outputs.place(now.clone());
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    });
    assert_eq!(peer.line("map "), "map 2 2 [0, 100, -1, 0]");
    assert_eq!(peer.line("tf "), "map odom 2.500 2.000");
    assert_eq!(peer.line("amcl_pose "), "map 4.000 2.000 0.0025");
    saying.abort();
}

async fn the_peer_is_a_robot(node: &RosNode, peer: &mut Peer) {
    let mut robot = RosRobot::connect(node, RosRobotConfig::default()).await.unwrap();
    let frame = soon(robot.sense()).await.unwrap();
    assert!((frame.odom_from_base.translation.x - 1.5).abs() < 1e-12, "{:?}", frame.odom_from_base);
    assert!((frame.odom_from_base.rotation.angle() - 0.5).abs() < 1e-12);
    assert_eq!(frame.scan.base_from_sensor, pose(0.2, 0.0, 0.0));
    assert_eq!((frame.scan.ranges_m.len(), frame.scan.ranges_m[7]), (360, 2.5));
    frame.check().unwrap();
    robot.drive(Twist { linear_mps: 0.25, angular_radps: -0.5 }).await.unwrap();
    assert_eq!(peer.line("cmd_vel "), "0.25 -0.5");

    the_peer_sees_where_the_robot_is(node, &robot, &frame, peer).await;

    // The LiDAR falls silent: the robot is stopped.
    let mut robot = Supervised::new(robot, SilenceConfig { stop_after_s: 0.5, end_after_s: 1.2 });
    robot.sense().await.unwrap();
    peer.tell("silence");
    let silent = Instant::now();
    let ended = loop {
        if let Err(error) = robot.sense().await {
            break error;
        }
        assert!(silent.elapsed() < PATIENCE, "it never falls silent");
    };
    assert!(ended.to_string().contains("silent"), "{ended}");
    assert_eq!(peer.line("cmd_vel "), "0.0 0.0");
    let robot = robot.into_inner();
    let trouble = robot.trouble().unwrap();
    assert!(trouble.starts_with("/scan has been silent for"), "{trouble}");
    assert!(robot.report().frames > 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_foreign_peer_hears_us_and_is_heard() {
    let port = fht_reserved_port::reserve().unwrap().port();
    let _router = router(port).await;
    let link = SessionConfig::from_options(vec![format!("tcp/127.0.0.1:{port}")], None);
    let session = fht_session::open(&link).await.unwrap();
    let node = RosNode::join(session, NodeConfig::new("mapper")).await.unwrap();

    // Published before the peer is there.
    let map = node.publisher("map", Qos::latched(1)).await.unwrap();
    let info = MapMetaData { resolution: 0.05, width: 3, height: 1, ..MapMetaData::default() };
    let header = HeaderMsg { frame_id: "map".to_owned(), ..HeaderMsg::default() };
    map.publish(&OccupancyGridMsg { header, info, data: vec![-1, 0, 100] }).unwrap();

    let folder = tempfile::tempdir().unwrap();
    let mut peer = Peer::start(port, folder.path());
    assert_eq!(peer.line("map "), "map 3 1 [-1, 0, 100]");
    peer.line("ready");
    topics_and_services(&node, &mut peer).await;
    the_peer_is_a_robot(&node, &mut peer).await;
    peer.tell("end");
}
