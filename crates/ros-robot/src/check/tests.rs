//! What goes wrong with robots, and the sentence that names the topic and what to do: as a check
//! says it of a graph, and as a running robot says it.

mod graphs;
mod lives;
mod seen;

use self::graphs::graphs;
use self::lives::lives;
use crate::camera_topics::chosen;
use crate::check::{Readiness, check};
use crate::config::RosRobotConfig;
use crate::intake::Intake;
use crate::pictures::Pictures;
use fht_perception::pose::pose;
use fht_ros::{Endpoint, EndpointKind, Qos, resolve};
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{
    ClockMsg, LaserScanMsg, OdometryMsg, PointCloud2, PointField, Pose, TfMessage, Time, TransformStamped, TwistStamped,
};

const MS: u64 = 1000;
/// 2026, microseconds.
const TODAY: u64 = 1_800_000_000_000_000;

fn endpoint(kind: EndpointKind, name: &str, ros_type: &str, qos: Qos) -> Endpoint {
    let node = format!("/r1/driver{}", name.replace('/', "_"));
    Endpoint { kind, name: name.to_owned(), ros_type: ros_type.to_owned(), hash: String::new(), qos, node }
}

/// A robot that has all that is needed.
fn robot() -> Vec<Endpoint> {
    use EndpointKind::{Publisher, Subscription};
    vec![
        endpoint(Publisher, "/r1/scan", LaserScanMsg::TYPE, Qos::sensor_data()),
        endpoint(Publisher, "/r1/odom", OdometryMsg::TYPE, Qos::default()),
        endpoint(Publisher, "/r1/tf", TfMessage::TYPE, Qos::default()),
        endpoint(Publisher, "/r1/tf_static", TfMessage::TYPE, Qos::latched(1)),
        endpoint(Subscription, "/r1/cmd_vel", TwistStamped::TYPE, Qos::default()),
    ]
}

/// What is done to a robot that is well, the topic, and words of what a check says of it.
type GraphCase = (fn(&mut Vec<Endpoint>, &mut RosRobotConfig), &'static str, Readiness, &'static [&'static str]);
/// How a robot is configured, what happens, and words of what it says.
type LifeCase = (fn(&mut RosRobotConfig), fn(&mut Running), &'static [&'static str]);

/// A robot that runs, and has run well for a second.
struct Running {
    intake: Intake,
    /// The stamp of the next messages, microseconds.
    stamp_us: u64,
}

impl Running {
    fn of(config: RosRobotConfig) -> Self {
        let scan = if config.points.is_some() { "/r1/points" } else { "/r1/scan" };
        let odometry = if config.has_odometry_in_tf() { "/r1/tf" } else { "/r1/odom" };
        let cameras = chosen(&config, &[], |name| resolve(name, "r1", "mapper")).expect("names");
        let intake = Intake::new(config, scan, odometry, "/clock");
        let intake = match cameras {
            Some(topics) => intake.with_pictures(Pictures::new(topics)),
            None => intake,
        };
        Self { intake, stamp_us: TODAY }
    }

    fn link(&mut self, parent: &str, child: &str, at: Pose) {
        let stamped = TransformStamped {
            header: header_message(self.stamp_us, parent),
            child_frame_id: child.to_owned(),
            transform: at,
        };
        self.intake.take_transforms(&TfMessage { transforms: vec![stamped] }, 0.9, self.stamp_us * 1000);
    }

    fn laser(&mut self) {
        self.link("base_link", "laser", pose_message(&pose(0.2, 0.0, 0.0)));
    }

    fn odometry(&mut self, change: impl FnOnce(&mut OdometryMsg)) {
        let mut message = OdometryMsg {
            header: header_message(self.stamp_us, "odom"),
            child_frame_id: "base_link".to_owned(),
            ..OdometryMsg::default()
        };
        change(&mut message);
        self.intake.take_odometry(&message, 0.9, self.stamp_us * 1000);
    }

    fn scan(&mut self, change: impl FnOnce(&mut LaserScanMsg)) {
        let mut message = LaserScanMsg {
            header: header_message(self.stamp_us, "laser"),
            angle_increment: 0.1,
            range_min: 0.1,
            range_max: 8.0,
            ranges: vec![1.0; 60],
            ..LaserScanMsg::default()
        };
        change(&mut message);
        self.intake.take_scan(message, 0.62, self.stamp_us * 1000);
    }

    fn points(&mut self, change: impl FnOnce(&mut PointCloud2<'static>)) {
        static DATA: [u8; 12] = [0; 12];
        let field =
            |(index, name): (u32, &str)| PointField { name: name.to_owned(), offset: 4 * index, datatype: 7, count: 1 };
        let mut cloud = PointCloud2 {
            header: header_message(self.stamp_us, "laser"),
            height: 1,
            width: 1,
            fields: (0..).zip(["x", "y", "z"]).map(field).collect(),
            point_step: 12,
            row_step: 12,
            data: &DATA,
            ..PointCloud2::default()
        };
        change(&mut cloud);
        self.intake.take_points(&cloud, 0.9, self.stamp_us * 1000);
    }

    fn clock(&mut self, time_us: u64, arrived_s: f64) {
        self.intake.take_clock(&ClockMsg { clock: Time::from_us(time_us) }, arrived_s);
    }

    /// A scan and odometry that fit.
    fn both(&mut self) {
        self.odometry(|_| {});
        self.scan(|_| {});
    }

    /// All that is said at the end of the second.
    fn said(mut self) -> String {
        let mut said = Vec::from_iter(self.intake.trouble(0.95));
        if self.intake.frame(0.95).is_none() {
            said.extend(self.intake.trouble(0.95));
        }
        said.extend(self.intake.take_doubts());
        said.join("; ")
    }
}

fn has_all(said: &str, words: &[&str]) {
    for part in words {
        assert!(said.contains(part), "'{said}' should say '{part}'");
    }
}

#[test]
fn fifty_things_that_are_wrong_are_told_with_the_topic_and_what_to_do() {
    let (graphs, lives) = (graphs(), lives());
    assert!(graphs.len() + lives.len() >= 50, "{} and {}", graphs.len(), lives.len());
    for (change, topic, readiness, words) in graphs {
        let (mut endpoints, mut config) = (robot(), RosRobotConfig::default());
        change(&mut endpoints, &mut config);
        let findings = check(&endpoints, &config, "r1").expect("names");
        let of_topic = findings.iter().filter(|finding| finding.topic == topic && finding.readiness == readiness);
        let said: Vec<&str> = of_topic.map(|finding| finding.sentence.as_str()).collect();
        has_all(&said.join("; "), words);
    }
    for (configure, live, words) in lives {
        let mut config = RosRobotConfig::default();
        configure(&mut config);
        let mut now = Running::of(config);
        live(&mut now);
        has_all(&now.said(), words);
    }
}

#[test]
fn a_robot_that_is_well_has_nothing_said_of_it() {
    let findings = check(&robot(), &RosRobotConfig::default(), "r1").expect("names");
    assert!(findings.len() == 5 && findings.iter().all(|finding| finding.readiness == Readiness::Good), "{findings:?}");
    let config = RosRobotConfig { odometry: "/tf".to_owned(), ..RosRobotConfig::default() };
    let findings = check(&robot(), &config, "r1").expect("names");
    assert!(findings.iter().all(|finding| finding.topic != "/r1/odom"));
    let config = RosRobotConfig { scan: "2d".to_owned(), ..config };
    assert!(check(&robot(), &config, "r1").is_err());
    let mut now = Running::of(RosRobotConfig::default());
    now.laser();
    now.both();
    assert_eq!(now.said(), "");
}
