//! A robot with a 3D LiDAR in a simulated time, on a graph: its points become frames by `/clock`,
//! and what is wrong with its clock is told.
#![allow(clippy::unwrap_used)] // tests may panic

use fht_perception::robot::Sensors;
use fht_ros::{NodeConfig, Publisher, Qos, RosNode};
use fht_ros_frames::header_message;
use fht_ros_messages::msg::{ClockMsg, OdometryMsg, PointCloud2, PointField, TfMessage, Time, TransformStamped};
use fht_ros_robot::{RosRobot, RosRobotConfig};
use std::time::Duration;
use tokio::time::timeout;

const PATIENCE: Duration = Duration::from_secs(20);

struct Driver {
    points: Publisher<PointCloud2<'static>>,
    odometry: Publisher<OdometryMsg>,
    clock: Publisher<ClockMsg>,
    _fixed: Publisher<TfMessage>,
}

impl Driver {
    async fn new(node: &RosNode) -> Self {
        let fixed = node.publisher("tf_static", Qos::latched(1)).await.unwrap();
        let mut mount = TransformStamped { child_frame_id: "lidar".to_owned(), ..TransformStamped::default() };
        mount.header = header_message(1, "base_link");
        mount.transform.position.z = 0.5;
        fixed.publish(&TfMessage { transforms: vec![mount] }).unwrap();
        Self {
            points: node.publisher("points", Qos::sensor_data()).await.unwrap(),
            odometry: node.publisher("odom", Qos::default()).await.unwrap(),
            clock: node.publisher("/clock", Qos::sensor_data()).await.unwrap(),
            _fixed: fixed,
        }
    }

    /// What it says at a time, seconds; its points have a stamp of their own.
    fn say(&self, at_s: u64, points_s: u64) {
        // A wall 2 m ahead, and the floor before it.
        static POINTS: [u8; 24] = [0, 0, 0, 64, 0, 0, 0, 0, 0, 0, 128, 190, 0, 0, 128, 63, 0, 0, 0, 0, 0, 0, 0, 191];
        let field =
            |(index, name): (u32, &str)| PointField { name: name.to_owned(), offset: 4 * index, datatype: 7, count: 1 };
        let cloud = PointCloud2 {
            header: header_message(points_s * 1_000_000, "lidar"),
            height: 1,
            width: 2,
            fields: (0..).zip(["x", "y", "z"]).map(field).collect(),
            point_step: 12,
            row_step: 24,
            data: &POINTS,
            ..PointCloud2::default()
        };
        let odometry = OdometryMsg {
            header: header_message(at_s * 1_000_000, "odom"),
            child_frame_id: "base_link".to_owned(),
            ..OdometryMsg::default()
        };
        self.clock.publish(&ClockMsg { clock: Time::from_us(at_s * 1_000_000) }).unwrap();
        self.odometry.publish(&odometry).unwrap();
        self.points.publish(&cloud).unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn points_become_frames_by_the_clock() {
    let mut config = zenoh::Config::default();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("listen/endpoints", "[]").unwrap();
    let session = zenoh::open(config).await.unwrap();
    let driver = Driver::new(&RosNode::join(session.clone(), NodeConfig::new("driver")).await.unwrap()).await;
    let node = RosNode::join(session, NodeConfig::new("mapper")).await.unwrap();
    let config = RosRobotConfig { points: Some("points".to_owned()), use_sim_time: true, ..RosRobotConfig::default() };
    let mut robot = RosRobot::connect(&node, config).await.unwrap();
    // Nobody has told the time.
    assert!(timeout(Duration::from_millis(500), robot.sense()).await.is_err());
    assert!(robot.trouble().is_some_and(|said| said.contains("nothing has come on /clock")), "{:?}", robot.trouble());

    driver.say(5, 5);
    let frame = timeout(PATIENCE, robot.sense()).await.unwrap().unwrap();
    assert_eq!(frame.time_us, 5_000_000);
    frame.check().unwrap();
    let ends = frame.scan.points_in_base();
    assert!(ends.len() == 1 && (ends[0].x - 2.0).hypot(ends[0].y) < 0.02, "{ends:?}");
    assert_eq!(robot.doubts().count(), 0);

    // Points of another time make no frame.
    driver.say(6, 1_800_000_000);
    assert!(timeout(Duration::from_millis(500), robot.sense()).await.is_err());
    let doubts: Vec<&str> = robot.doubts().collect();
    assert!(doubts.len() == 1 && doubts[0].contains("/points are of another clock"), "{doubts:?}");
    driver.say(7, 7);
    assert_eq!(timeout(PATIENCE, robot.sense()).await.unwrap().unwrap().time_us, 7_000_000);

    // The simulation begins anew: nothing fits to what was before.
    driver.say(2, 2);
    for _ in 0..2 {
        let error = timeout(PATIENCE, robot.sense()).await.unwrap().unwrap_err();
        let said = error.to_string();
        assert!(said.contains("/clock has gone back by 5.0 s") && said.contains("start again"), "{said}");
        assert_eq!(robot.trouble(), None, "the error says it");
    }
}
