//! `client-robot route` in the place of Nav2's planner server: an action client on a robot's graph
//! asks for paths, and they are those of the fleet's map.

use crate::programs::{executable, start};
use fht_demo::{Process, Role, free_endpoint};
use fht_perception::pose::{Pose2, pose};
use fht_proto::api::fleet::LocalizationState;
use fht_ros::{ActionClient, NodeConfig, Qos, RosNode};
use fht_ros_frames::{header_message, pose_message, yaw_of};
use fht_ros_messages::GetResultResponse;
use fht_ros_messages::msg::{GoalStatusMsg, PoseStamped, TfMessage, TransformStamped};
use fht_ros_messages::nav2::{ComputePathToPose, ComputePathToPoseGoal, ComputePathToPoseResult};
use fht_ros_robot::{OutputRole, PlaceNow, RosOutputs, RosRobot, RosRobotConfig};
use fht_session::SessionConfig;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(120);

fn at(x: f64, y: f64, yaw: f64) -> PoseStamped {
    PoseStamped { header: header_message(1, "map"), pose: pose_message(&pose(x, y, yaw)) }
}

async fn asked(
    planner: &ActionClient<ComputePathToPose>,
    goal: ComputePathToPoseGoal,
) -> GetResultResponse<ComputePathToPoseResult> {
    planner.send(goal).await.unwrap().result().await.unwrap()
}

/// The robot says where it is, again and again, as one that knows its place does.
async fn say_place(node: &RosNode, map_from_base: Pose2) -> tokio::task::JoinHandle<()> {
    let robot = RosRobot::connect(node, RosRobotConfig::default()).await.unwrap();
    let outputs = RosOutputs::start(node, OutputRole::Localization, robot.odom_frame()).await.unwrap();
    let transforms = node.publisher("tf", Qos::default()).await.unwrap();
    let odom_from_base = TransformStamped {
        header: header_message(1, "odom"),
        child_frame_id: "base_link".to_owned(),
        transform: pose_message(&pose(0.0, 0.0, 0.0)),
    };
    let place = PlaceNow {
        time_us: 1,
        state: LocalizationState::Localized,
        confidence: 1.0,
        odom_from_base: pose(0.0, 0.0, 0.0),
        map_from_base: Some(map_from_base),
        candidates: Vec::new(),
        lost_because: None,
    };
    tokio::spawn(async move {
        loop {
            outputs.place(place.clone());
            let transforms_now = TfMessage { transforms: vec![odom_from_base.clone()] };
            transforms.publish(&transforms_now).unwrap();
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    })
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nav2_gets_the_paths_of_the_fleets_map() {
    let folder = tempfile::tempdir().unwrap();
    let (graph, maps) = (free_endpoint().unwrap(), free_endpoint().unwrap());
    let _server = Process::map_server(executable(), folder.path(), &maps, PATIENCE).unwrap();
    let mapped = ["explore", "--no-cameras", "--connect", &maps, "--map", "lab", "--quiet"];
    start(Role::Mapper, mapped).finish(PATIENCE).unwrap();
    let mut router = start(Role::Sim, ["router", "--listen", &graph]);
    router.wait_until_listening(&graph, PATIENCE).unwrap();
    let _route = start(Role::ClientRobot, ["route", "--map", "lab", "--connect", &maps, "--ros", &graph]);

    let link = SessionConfig::from_options(vec![graph], None);
    let node = RosNode::join(fht_session::open(&link).await.unwrap(), NodeConfig::new("navigator")).await.unwrap();
    let planner = node.action_client::<ComputePathToPose>("compute_path_to_pose").await.unwrap();
    let far = ComputePathToPoseGoal { goal: at(5.0, 3.0, 1.5), ..Default::default() };
    let from_origin = ComputePathToPoseGoal { start: at(0.0, 0.0, 0.0), use_start: true, ..far.clone() };
    let began = Instant::now();
    let path = loop {
        // The server's node may not be there yet.
        match planner.send(from_origin.clone()).await {
            Ok(sent) => break sent.result().await.unwrap(),
            Err(error) => assert!(began.elapsed() < PATIENCE, "{error}"),
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    };
    assert_eq!((path.status, path.result.error_code), (GoalStatusMsg::SUCCEEDED, 0), "{:?}", path.result.error_msg);
    let poses = &path.result.path.poses;
    let (first, last) = (poses.first().unwrap(), poses.last().unwrap());
    assert_eq!((path.result.path.header.frame_id.as_str(), first.header.frame_id.as_str()), ("map", "map"));
    assert!(first.pose.position.x.hypot(first.pose.position.y) < 0.01, "{first:?}");
    assert!((last.pose.position.x - 5.0).hypot(last.pose.position.y - 3.0) < 0.01, "{last:?}");
    assert!((yaw_of(&last.pose.orientation).unwrap() - 1.5).abs() < 1e-9 && poses.len() > 100, "{last:?}");

    // Where the robot is nobody has said yet.
    let nowhere = asked(&planner, far.clone()).await;
    assert_eq!((nowhere.status, nowhere.result.error_code), (GoalStatusMsg::ABORTED, 202));
    assert!(nowhere.result.error_msg.contains("base_link"), "{}", nowhere.result.error_msg);
    let saying = say_place(&node, pose(1.0, 0.5, 0.0)).await;
    tokio::time::sleep(Duration::from_secs(1)).await;
    let from_robot = asked(&planner, far).await;
    assert_eq!(from_robot.status, GoalStatusMsg::SUCCEEDED, "{}", from_robot.result.error_msg);
    let first = from_robot.result.path.poses.first().unwrap().pose.position;
    assert!((first.x - 1.0).hypot(first.y - 0.5) < 0.01, "{first:?}");
    saying.abort();

    // A goal that the map does not have.
    let outside = ComputePathToPoseGoal { goal: at(500.0, 3.0, 0.0), ..from_origin };
    let outside = asked(&planner, outside).await;
    assert_eq!(outside.status, GoalStatusMsg::ABORTED);
    assert!([204, 208].contains(&outside.result.error_code), "{:?}", outside.result);
    assert!(!outside.result.error_msg.is_empty());
}
