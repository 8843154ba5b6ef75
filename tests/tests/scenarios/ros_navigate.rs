//! Goals by Nav2's action `navigate_to_pose`, both ways: `client-robot serve --ros` takes them in
//! the place of Nav2, and with `--drive nav2` the client sends them, and a Nav2 drives. The robot
//! is a simulated one with ROS 2; the Nav2 is a small one made here, which drives straight ahead.
//! People who point at wrong places (`initialpose`) do no harm.

use crate::programs::{executable, start};
use fht_demo::{Process, Role, free_endpoint};
use fht_perception::pose::{Point2, Pose2, pose, wrap_angle};
use fht_ros::{ActionClient, ActionServer, ActiveGoal, NodeConfig, Publisher, Qos, RosNode, SentGoal, Subscription};
use fht_ros_frames::{Mount, TransformTree, header_message, pose_message, yaw_of};
use fht_ros_messages::msg::{
    GoalStatusMsg, OdometryMsg, PoseStamped, PoseWithCovarianceStamped, TfMessage, TwistMsg, TwistStamped, Vector3,
};
use fht_ros_messages::nav2::{NavigateToPose, NavigateToPoseGoal, NavigateToPoseResult};
use fht_session::SessionConfig;
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(600);
/// Between a refused question and the next.
const AGAIN: Duration = Duration::from_millis(300);

/// A map of the museum at a server, and a simulated robot at a router of its own.
struct Site {
    maps: String,
    graph: String,
    node: RosNode,
    _processes: Vec<Process>,
    _folder: tempfile::TempDir,
}

impl Site {
    async fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (graph, maps) = (free_endpoint().unwrap(), free_endpoint().unwrap());
        let server = Process::map_server(executable(), folder.path(), &maps, PATIENCE).unwrap();
        let mapped = ["explore", "--no-cameras", "--connect", &maps, "--map", "lab", "--quiet"];
        start(Role::Mapper, mapped).finish(PATIENCE).unwrap();
        let mut router = start(Role::Sim, ["router", "--listen", &graph]);
        router.wait_until_listening(&graph, PATIENCE).unwrap();
        // It waits for commands, which come late on a busy machine, and is slow enough to be asked
        // how it goes while it drives.
        let robot = start(Role::Sim, ["robot", "--ros", &graph, "--in-step", "--rate", "4", "--quiet"]);
        let link = SessionConfig::from_options(vec![graph.clone()], None);
        let session = fht_session::open(&link).await.unwrap();
        let node = RosNode::join(session, NodeConfig::new("person")).await.unwrap();
        Self { maps, graph, node, _processes: vec![server, router, robot], _folder: folder }
    }

    fn client(&self, task: &[&str]) -> Process {
        let link = ["--map", "lab", "--connect", &self.maps, "--ros", &self.graph];
        start(Role::ClientRobot, [&task[..1], &link, &task[1..]].concat())
    }
}

fn goal(x: f64, y: f64, yaw: f64) -> NavigateToPoseGoal {
    let pose = PoseStamped { header: header_message(1, "map"), pose: pose_message(&pose(x, y, yaw)) };
    NavigateToPoseGoal { pose, behavior_tree: String::new() }
}

/// Sends a goal until the robot is there, knows its place and takes it.
async fn drives(client: &ActionClient<NavigateToPose>, goal: &NavigateToPoseGoal) -> SentGoal<NavigateToPose> {
    let began = Instant::now();
    loop {
        assert!(began.elapsed() < PATIENCE, "it never drives");
        if let Ok(sent) = client.send(goal.clone()).await {
            tokio::select! {
                feedback = moving(&sent) => {
                    assert_eq!(feedback.current_pose.header.frame_id, "map", "{feedback:?}");
                    return sent;
                }
                ended = sent.result() => {
                    let result = ended.unwrap().result;
                    assert!(result.error_msg.contains("does not know where it is"), "{result:?}");
                }
            }
        }
        tokio::time::sleep(AGAIN).await;
    }
}

/// How it goes once the robot is under way.
async fn moving(sent: &SentGoal<NavigateToPose>) -> fht_ros_messages::nav2::NavigateToPoseFeedback {
    loop {
        let feedback = sent.feedback().await.unwrap();
        if feedback.distance_remaining > 0.5 {
            return feedback;
        }
    }
}

/// Somebody says again and again that the robot is where it is not.
async fn point_wrongly(node: &RosNode) -> tokio::task::JoinHandle<()> {
    let pointing = node.publisher("initialpose", Qos::default()).await.unwrap();
    tokio::spawn(async move {
        for step in (0_u8..4).cycle() {
            let wrong = pose(3.0 * f64::from(step), 2.0, f64::from(step));
            let mut said = PoseWithCovarianceStamped { header: header_message(1, "map"), ..Default::default() };
            said.pose.pose = pose_message(&wrong);
            pointing.publish(&said).unwrap();
            tokio::time::sleep(Duration::from_millis(500)).await;
        }
    })
}

async fn takes_goals(site: &Site) {
    let _robot = site.client(&["serve", "--robot", "tug"]);
    let client = site.node.action_client::<NavigateToPose>("navigate_to_pose").await.unwrap();
    let truth = site.node.subscribe::<OdometryMsg>("ground_truth", Qos::sensor_data()).await.unwrap();
    let pointing = point_wrongly(&site.node).await;
    let there = drives(&client, &goal(5.0, 3.0, 1.5)).await;
    let end = there.result().await.unwrap();
    assert_eq!((end.status, end.result.error_code), (GoalStatusMsg::SUCCEEDED, 0), "{:?}", end.result.error_msg);
    // It is truly there, wherever people thought that it was.
    while truth.take_raw().is_some() {}
    let at = truth.next().await.unwrap().pose.pose.position;
    let at = fht_sim::load("museum", None, 0).unwrap().start().inverse() * Point2::new(at.x, at.y);
    assert!((at - Point2::new(5.0, 3.0)).norm() < 0.3, "{at}");
    pointing.abort();

    let back = drives(&client, &goal(0.0, 0.0, 0.0)).await;
    assert!(back.cancel().await.unwrap());
    let end = back.result().await.unwrap();
    assert_eq!(end.status, GoalStatusMsg::CANCELED, "{:?}", end.result.error_msg);

    // A goal takes the place of the one before.
    let first = drives(&client, &goal(0.0, 0.0, 0.0)).await;
    let second = drives(&client, &goal(1.0, 0.5, 0.0)).await;
    let end = first.result().await.unwrap();
    assert_eq!(end.status, GoalStatusMsg::ABORTED, "{:?}", end.result);

    let outside = client.send(goal(500.0, 3.0, 0.0)).await.unwrap().result().await.unwrap();
    assert_eq!((outside.status, outside.result.error_code), (GoalStatusMsg::ABORTED, 204), "{:?}", outside.result);
    let mut nowhere = goal(1.0, 0.0, 0.0);
    nowhere.pose.header.frame_id = "dock".to_owned();
    let nowhere = client.send(nowhere).await.unwrap().result().await.unwrap();
    assert_eq!((nowhere.status, nowhere.result.error_code), (GoalStatusMsg::ABORTED, 9002), "{:?}", nowhere.result);
    // What was refused has left the other as it was.
    let end = second.result().await.unwrap();
    assert_eq!(end.status, GoalStatusMsg::SUCCEEDED, "{:?}", end.result.error_msg);
}

/// A Nav2 that drives straight ahead: the transforms say where the robot is.
struct SmallNav2 {
    server: ActionServer<NavigateToPose>,
    transforms: Subscription<TfMessage>,
    commands: Publisher<TwistStamped>,
    tree: TransformTree,
    goals: Arc<AtomicUsize>,
}

impl SmallNav2 {
    async fn new(node: &RosNode) -> Self {
        Self {
            server: node.action_server("navigate_to_pose").await.unwrap(),
            transforms: node.subscribe("tf", Qos { depth: 100, ..Qos::sensor_data() }).await.unwrap(),
            commands: node.publisher("cmd_vel", Qos::default()).await.unwrap(),
            tree: TransformTree::default(),
            goals: Arc::default(),
        }
    }

    fn drive(&self, linear: f64, angular: f64) {
        let twist = TwistMsg {
            linear: Vector3 { x: linear, ..Vector3::default() },
            angular: Vector3 { z: angular, ..Vector3::default() },
        };
        self.commands.publish(&TwistStamped { twist, ..TwistStamped::default() }).unwrap();
    }

    /// Steers to `goal`; whether it is there.
    fn steer(&self, goal: &Pose2) -> bool {
        let Some(base) = self.tree.base_from("map", "base_link") else { return false };
        let at = Mount::of(&base).base_from_sensor;
        let way = goal.translation.vector - at.translation.vector;
        let wanted = if way.norm() < 0.2 { goal.rotation.angle() } else { way.y.atan2(way.x) };
        let turn = wrap_angle(wanted - at.rotation.angle());
        let is_there = way.norm() < 0.2 && turn.abs() < 0.1;
        let linear = if way.norm() >= 0.2 && turn.abs() < 0.3 { 0.3_f64.min(way.norm()) } else { 0.0 };
        if is_there {
            self.drive(0.0, 0.0);
        } else {
            self.drive(linear, turn.clamp(-0.8, 0.8));
        }
        is_there
    }

    async fn run(mut self) {
        let mut active: Option<(ActiveGoal<NavigateToPose>, Pose2)> = None;
        loop {
            tokio::select! {
                request = self.server.next() => {
                    let at = request.goal.pose.pose;
                    let yaw = yaw_of(&at.orientation).unwrap();
                    let goal = request.accept().unwrap();
                    self.goals.fetch_add(1, Ordering::Relaxed);
                    if let Some((before, _)) = active.replace((goal, pose(at.position.x, at.position.y, yaw))) {
                        before.abort(NavigateToPoseResult::default());
                    }
                }
                message = self.transforms.next() => {
                    let transforms = message.unwrap().transforms;
                    let is_odometry = transforms.iter().any(|link| link.child_frame_id == "base_link");
                    transforms.iter().for_each(|link| assert!(self.tree.insert(link)));
                    if !is_odometry {
                        continue;
                    }
                    let Some((goal, at)) = active.take() else { continue };
                    if goal.is_canceling() {
                        self.drive(0.0, 0.0);
                        goal.canceled(NavigateToPoseResult::default());
                    } else if self.steer(&at) {
                        goal.succeed(NavigateToPoseResult::default());
                    } else {
                        goal.feedback(Default::default()).unwrap();
                        active = Some((goal, at));
                    }
                }
            }
        }
    }
}

async fn has_nav2_drive(site: &Site) {
    let go = |more: &[&str]| {
        // In sight: the small Nav2 plans nothing.
        site.client(&[&["go", "--robot", "tug", "--to", "1.5,-3.5", "--json", "--drive", "nav2"], more].concat())
    };
    // There is none.
    let nobody = go(&["--max-sim", "200"]).finish(PATIENCE).err().map(|error| error.to_string()).unwrap();
    assert!(nobody.contains("nobody serves /navigate_to_pose"), "{nobody}");

    let nav2 = SmallNav2::new(&site.node).await;
    let goals = Arc::clone(&nav2.goals);
    let driving = tokio::spawn(nav2.run());
    let report: Value = serde_json::from_str(&go(&[]).finish(PATIENCE).unwrap()).unwrap();
    assert_eq!(report["arrived"], true, "{report}");
    let end = Point2::new(report["end"][0].as_f64().unwrap(), report["end"][1].as_f64().unwrap());
    assert!((end - Point2::new(1.5, -3.5)).norm() < 0.35, "{report}");
    assert!(goals.load(Ordering::Relaxed) >= 1, "Nav2 was asked {goals:?} times");
    driving.abort();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn goals_of_nav2_are_taken_and_given() {
    let site = Site::new().await;
    takes_goals(&site).await;
    has_nav2_drive(&site).await;
}
