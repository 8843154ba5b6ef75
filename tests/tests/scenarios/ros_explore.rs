//! `mapper explore --ros` drives a robot that speaks ROS 2: the simulator behind `/scan`, `/odom`,
//! `/tf_static` and `/cmd_vel`. When its LiDAR falls silent the robot is stopped, the topic is
//! named, and all goes on when it is back. `mapper ros check` says what a robot has. So it is with
//! a robot behind zenoh-bridge-ros2dds, by what such a bridge writes.

use crate::programs::executable;
use fht_demo::{Role, free_endpoint};
use fht_perception::frame::{SensorFrame, Twist};
use fht_perception::pose::{Pose2, pose};
use fht_ros::{KeyForm, NodeConfig, Publisher, Qos, RosNode, Subscription};
use fht_ros_frames::{header_message, pose_message, scan_message};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{LaserScanMsg, OdometryMsg, PoseWithCovariance, TfMessage, TransformStamped, TwistStamped};
use fht_sim::{SimConfig, Simulator, load};
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::time::timeout;

/// The simulator's clock begins at 0, which to ROS is no time.
const BEGIN_US: u64 = 1_000_000_000;
/// Longer than a driver's watchdog: the robot stands.
const WATCHDOG: Duration = Duration::from_millis(200);

fn mapper(args: &[&str]) -> Child {
    Command::new(executable())
        .args(["role", Role::Mapper.name(), "--"])
        .args(args)
        .env("RUST_LOG", "info")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// A robot's router, and a session at it.
async fn graph() -> (String, zenoh::Session) {
    let endpoint = format!("tcp/{}", fht_reserved_port::reserve().unwrap());
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "'router'").unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("listen/endpoints", &format!("['{endpoint}']")).unwrap();
    (endpoint, zenoh::open(config).await.unwrap())
}

/// A simulated robot as a node.
struct SimulatedRobot {
    simulator: Simulator,
    scans: Publisher<LaserScanMsg>,
    odometry: Publisher<OdometryMsg>,
    _transforms: Publisher<TfMessage>,
    commands: Subscription<TwistStamped>,
}

impl SimulatedRobot {
    async fn new(node: &RosNode) -> Self {
        let world = Arc::new(load("museum", None, 1).unwrap());
        let start = world.start();
        let config = SimConfig { camera_every: 0, ..SimConfig::default() };
        let simulator = Simulator::new(world, config, start, 1);
        let transforms = node.publisher("tf_static", Qos::latched(1)).await.unwrap();
        let mut mount = TransformStamped { child_frame_id: "laser".to_owned(), ..TransformStamped::default() };
        mount.header = header_message(BEGIN_US, "base_link");
        let [x, y, _] = simulator.config().lidar_mount_m;
        mount.transform = pose_message(&pose(x, y, 0.0));
        transforms.publish(&TfMessage { transforms: vec![mount] }).unwrap();
        Self {
            simulator,
            scans: node.publisher("scan", Qos::sensor_data()).await.unwrap(),
            odometry: node.publisher("odom", Qos::default()).await.unwrap(),
            _transforms: transforms,
            commands: node.subscribe("cmd_vel", Qos::default()).await.unwrap(),
        }
    }

    fn publish(&self, frame: &SensorFrame) {
        let time_us = BEGIN_US + frame.time_us;
        let pose: &Pose2 = &frame.odom_from_base;
        let odometry = OdometryMsg {
            header: header_message(time_us, "odom"),
            child_frame_id: "base_link".to_owned(),
            pose: PoseWithCovariance { pose: pose_message(pose), ..PoseWithCovariance::default() },
            ..OdometryMsg::default()
        };
        self.odometry.publish(&odometry).unwrap();
        self.scans.publish(&scan_message(&frame.scan, header_message(time_us, "laser"), 0.1)).unwrap();
    }

    /// The next command; none: the robot's watchdog has stopped it.
    async fn command(&self, patience: Duration) -> Option<Twist> {
        let command = timeout(patience, self.commands.next()).await.ok()?.unwrap();
        assert_eq!(command.header.frame_id, "base_link");
        Some(Twist { linear_mps: command.twist.linear.x, angular_radps: command.twist.angular.z })
    }

    /// Falls silent, and returns how long it took until the robot was told to stop.
    async fn silence(&self) -> Duration {
        let silent = Instant::now();
        while let Some(command) = self.command(Duration::from_secs(5)).await {
            if command == Twist::default() {
                return silent.elapsed();
            }
        }
        panic!("it is not told to stop");
    }
}

fn output_of(child: Child) -> Output {
    child.wait_with_output().unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_with_ros_is_explored_with_and_stops_when_its_lidar_is_silent() {
    let (endpoint, router) = graph().await;
    let node =
        RosNode::join(router, NodeConfig { namespace: "r1".to_owned(), ..NodeConfig::new("driver") }).await.unwrap();
    let mut robot = SimulatedRobot::new(&node).await;
    let flags =
        ["explore", "--ros", &endpoint, "--namespace", "r1", "--offline", "--max-sim", "40", "--json", "--quiet"];
    let mut child = mapper(&flags);
    while !robot.scans.is_heard().await.unwrap() {
        assert!(child.try_wait().unwrap().is_none(), "the mapper has ended");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let mut frame = robot.simulator.sense_first();
    let (mut stops, mut driven) = (Vec::new(), 0);
    while child.try_wait().unwrap().is_none() {
        robot.publish(&frame);
        let command = robot.command(WATCHDOG).await.unwrap_or_default();
        driven += usize::from(command != Twist::default());
        // Three times while it drives.
        if driven > 0 && driven % 10 == 0 && stops.len() < 3 && command != Twist::default() {
            stops.push(robot.silence().await);
        }
        frame = robot.simulator.step(command);
    }
    let output = output_of(child);
    let said = String::from_utf8(output.stderr).unwrap();
    println!("stops {stops:?}\n{said}");
    // The time is over before the museum is.
    assert_eq!(output.status.code(), Some(1), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["ending"], "out_of_time", "{report}");
    assert!(report["frames"].as_u64().unwrap() > 100 && report["free_area_m2"].as_f64().unwrap() > 20.0, "{report}");
    assert!(report["support_nodes"].as_u64().unwrap() > 0, "{report}");
    assert_eq!(robot.simulator.collisions(), 0);
    assert_eq!(stops.len(), 3);
    // The processors are shared: one of them shows what the program does.
    assert!(stops.iter().min().unwrap() < &Duration::from_millis(500), "{stops:?}");
    assert!(said.contains("/r1/scan has been silent for"), "{said}");
    assert!(said.contains("the sensors are back"), "{said}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_check_says_what_a_robot_has_and_lacks() {
    let (endpoint, router) = graph().await;
    let node = RosNode::join(router, NodeConfig { domain: 3, ..NodeConfig::new("driver") }).await.unwrap();
    let check = |flags: &[&str]| {
        let child = mapper(&[&["ros", "check", &endpoint, "--wait", "2"], flags].concat());
        let output = output_of(child);
        (output.status.code(), String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap())
    };
    let mut robot = SimulatedRobot::new(&node).await;
    let frame = robot.simulator.sense_first();
    let (code, said) = tokio::task::block_in_place(|| check(&["--domain", "3"]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("good      /scan: /driver publishes it (sensor_msgs/msg/LaserScan)"), "{said}");
    assert!(said.contains("good      /cmd_vel: /driver subscribes to it (geometry_msgs/msg/TwistStamped)"), "{said}");
    assert!(said.contains("no frame  nothing has come on /scan"), "{said}");
    // In another domain it has nothing.
    let (code, said) = tokio::task::block_in_place(|| check(&["--domain", "4"]));
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("missing   /scan: nobody publishes it"), "{said}");

    let publishing = tokio::spawn(async move {
        for step in 0..100_000_u64 {
            robot.publish(&SensorFrame { time_us: step * 50_000, ..frame.clone() });
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    });
    let (code, said) = tokio::task::block_in_place(|| check(&["--domain", "3"]));
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("frames    "), "{said}");
    publishing.abort();
}

/// A bridge's tokens for a robot whose nodes speak DDS.
async fn bridge_tokens(session: &zenoh::Session) -> Vec<zenoh::liveliness::LivelinessToken> {
    let endpoint = |kind: &str, topic: &str, ros_type: &str, qos: &str| {
        format!("@/c0ffee/@ros2_lv/{kind}/r1§{topic}/{}/{qos}", ros_type.replace('/', "§"))
    };
    let mut tokens = Vec::new();
    for token in [
        "@/c0ffee/@ros2_lv".to_owned(),
        endpoint("MP", "scan", LaserScanMsg::TYPE, ":0:0:0,5"),
        endpoint("MP", "odom", OdometryMsg::TYPE, ":1:0:0,10"),
        endpoint("MP", "tf_static", TfMessage::TYPE, ":1:1:0,1"),
        endpoint("MS", "cmd_vel", TwistStamped::TYPE, ":1:0:0,1"),
    ] {
        tokens.push(session.liveliness().declare_token(token).await.unwrap());
    }
    tokens
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_robot_behind_a_bridge_is_checked_and_explored_with() {
    let (endpoint, router) = graph().await;
    let _tokens = bridge_tokens(&router).await;
    let form = KeyForm::Bridge;
    let node = RosNode::join(router, NodeConfig { namespace: "r1".to_owned(), form, ..NodeConfig::new("driver") })
        .await
        .unwrap();
    let mut robot = SimulatedRobot::new(&node).await;
    let of_robot = ["--namespace", "r1", "--ros-keys", "bridge"];
    let output = tokio::task::block_in_place(|| {
        output_of(mapper(&[&["ros", "check", &endpoint, "--wait", "2"][..], &of_robot].concat()))
    });
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(said.contains("good      /r1/scan: c0ffee publishes it (sensor_msgs/msg/LaserScan)"), "{said}");
    assert!(said.contains("good      /r1/cmd_vel: c0ffee subscribes to it"), "{said}");

    let explore = ["explore", "--ros", &endpoint, "--offline", "--max-sim", "20", "--json", "--quiet"];
    let mut child = mapper(&[&explore[..], &of_robot].concat());
    while !robot.scans.is_heard().await.unwrap() {
        assert!(child.try_wait().unwrap().is_none(), "the mapper has ended");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let (mut frame, mut driven) = (robot.simulator.sense_first(), 0);
    while child.try_wait().unwrap().is_none() {
        robot.publish(&frame);
        let command = robot.command(WATCHDOG).await.unwrap_or_default();
        driven += usize::from(command != Twist::default());
        frame = robot.simulator.step(command);
    }
    let report: serde_json::Value = serde_json::from_slice(&output_of(child).stdout).unwrap();
    assert!(report["frames"].as_u64().unwrap() > 50 && driven > 20, "{driven}: {report}");
    assert!(report["support_nodes"].as_u64().unwrap() > 0, "{report}");
}

#[test]
fn a_robots_router_is_waited_for_as_long_as_the_user_says() {
    let begin = Instant::now();
    let endpoint = free_endpoint().unwrap();
    let output = output_of(mapper(&["explore", "--ros", &endpoint, "--wait", "1", "--offline", "--quiet"]));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && said.contains(&endpoint), "{:?}: {said}", output.status);
    assert!(begin.elapsed() < Duration::from_secs(15), "{:?}", begin.elapsed());
}
