//! What is wrong with a graph.

use super::{GraphCase, endpoint};
use crate::check::Readiness;
use crate::config::RosRobotConfig;
use fht_ros::{Endpoint, EndpointKind, Qos};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{
    ClockMsg, CompressedImage, Image, OccupancyGridMsg, PointCloud2, PoseStamped, TfMessage, TwistMsg, TwistStamped,
};

/// Adds a second endpoint like that of this index, of another node.
fn again(all: &mut Vec<Endpoint>, index: usize) {
    let second = Endpoint { node: "/other".to_owned(), ..all[index].clone() };
    all.push(second);
}

fn add(all: &mut Vec<Endpoint>, kind: EndpointKind, name: &str, ros_type: &str) {
    all.push(endpoint(kind, name, ros_type, Qos::default()));
}

/// What is done to a robot that is well, the topic, and words of what a check says of it.
pub(super) fn graphs() -> Vec<GraphCase> {
    let mut all = absences();
    all.extend(twins());
    all.extend(company());
    all.extend(cameras());
    all
}

/// Adds four cameras with these names, and forgets those of the usual ones.
fn see(all: &mut Vec<Endpoint>, names: [&str; 4]) {
    for name in names {
        add(all, EndpointKind::Publisher, name, Image::TYPE);
    }
}

/// The usual cameras, but for one.
fn all_but_left(all: &mut Vec<Endpoint>) {
    for name in ["front", "back", "right"] {
        let topic = format!("/r1/camera_{name}/image/compressed");
        add(all, EndpointKind::Publisher, &topic, CompressedImage::TYPE);
    }
}

fn name_cameras(config: &mut RosRobotConfig) {
    config.cameras = Some(["/a", "/b", "/c", "/d"].map(|name| format!("{name}/image_raw")));
}

fn cameras() -> Vec<GraphCase> {
    use Readiness::{Doubtful, Missing};
    vec![
        (
            |all, _| all_but_left(all),
            "/r1/camera_left/image",
            Doubtful,
            &["nobody publishes it, and a panorama needs all four", "--cameras"],
        ),
        (
            |all, _| {
                all_but_left(all);
                add(all, EndpointKind::Publisher, "/r1/camera_left/image/compressed", CompressedImage::TYPE);
                again(all, 5);
            },
            "/r1/camera_front/image/compressed",
            Doubtful,
            &["/other publish it: two cameras with the same names", "namespace"],
        ),
        (
            |_, config| name_cameras(config),
            "/b/image_raw",
            Missing,
            &["nobody publishes it", "start the camera's driver"],
        ),
        (
            |all, config| {
                name_cameras(config);
                see(all, ["/a/image_raw", "/b/image_color", "/c/image_raw", "/d/image_raw"]);
            },
            "/b/image_raw",
            Missing,
            &["there is /a/image_raw", "/b/image_color", "is that the topic"],
        ),
        (
            |all, config| {
                name_cameras(config);
                add(all, EndpointKind::Publisher, "/d/image_raw", PointCloud2::TYPE);
            },
            "/d/image_raw",
            Missing,
            &["has sensor_msgs/msg/PointCloud2, not sensor_msgs/msg/Image or sensor_msgs/msg/CompressedImage"],
        ),
        (
            |all, _| see(all, ["/a/image", "/b/image", "/c/image", "/d/image"]),
            "/a/image",
            Doubtful,
            &["there are pictures on /a/image", "none of them are used", "say --cameras"],
        ),
    ]
}

/// What is not there, or of another name or type.
fn absences() -> Vec<GraphCase> {
    use Readiness::Missing;
    vec![
        (|all, _| all.clear(), "/r1/scan", Missing, &["nobody publishes it (sensor_msgs/msg/LaserScan)", "start what"]),
        (|all, _| all.clear(), "/r1/odom", Missing, &["nobody publishes it (nav_msgs/msg/Odometry)", "domain"]),
        (|all, _| all.clear(), "/r1/tf_static", Missing, &["nobody publishes it (tf2_msgs/msg/TFMessage)"]),
        (|all, _| all.clear(), "/r1/cmd_vel", Missing, &["nobody subscribes to it", "start what subscribes"]),
        (|all, _| all[0].name = "/scan".to_owned(), "/r1/scan", Missing, &["there is /scan: is that the topic"]),
        (|all, _| all[1].name = "/r1/wheel_odom".to_owned(), "/r1/odom", Missing, &["there is /r1/wheel_odom"]),
        (|all, _| all[3].name = "/tf_static".to_owned(), "/r1/tf_static", Missing, &["/tf_static", "namespace?"]),
        (|all, _| all[4].name = "/cmd_vel".to_owned(), "/r1/cmd_vel", Missing, &["there is /cmd_vel"]),
        (|all, _| drop(all.remove(3)), "/r1/tf_static", Missing, &["there is /r1/tf: is that the topic"]),
        (
            |all, _| all[0].ros_type = PointCloud2::TYPE.to_owned(),
            "/r1/scan",
            Missing,
            &["has sensor_msgs/msg/PointCloud2, not sensor_msgs/msg/LaserScan", "say --points /r1/scan"],
        ),
        (
            |_, config| config.points = Some("scan".to_owned()),
            "/r1/scan",
            Missing,
            &["has sensor_msgs/msg/LaserScan, not sensor_msgs/msg/PointCloud2", "say --scan-topic /r1/scan"],
        ),
        (
            |all, _| all[1].ros_type = TfMessage::TYPE.to_owned(),
            "/r1/odom",
            Missing,
            &["has tf2_msgs/msg/TFMessage, not nav_msgs/msg/Odometry", "--odom-topic tf"],
        ),
        (
            |all, _| all[1].ros_type = PoseStamped::TYPE.to_owned(),
            "/r1/odom",
            Missing,
            &["PoseStamped", "name the topic"],
        ),
        (
            |all, _| all[4].ros_type = PoseStamped::TYPE.to_owned(),
            "/r1/cmd_vel",
            Missing,
            &["PoseStamped, not geometry"],
        ),
    ]
}

/// What is there twice, or with another quality of service.
fn twins() -> Vec<GraphCase> {
    use EndpointKind::Publisher;
    use Readiness::{Doubtful, Missing};
    vec![
        (
            |all, _| again(all, 0),
            "/r1/scan",
            Doubtful,
            &["/other publish it: two robots with the same names?", "namespace"],
        ),
        (|all, _| again(all, 1), "/r1/odom", Doubtful, &["/other publish it: two robots", "or a router"]),
        (
            |all, _| all[3].qos = Qos::default(),
            "/r1/tf_static",
            Doubtful,
            &["published volatile and asked for transient-local"],
        ),
        (
            |all, _| all[2].qos = Qos::sensor_data(),
            "/r1/tf",
            Doubtful,
            &["published best-effort and asked for reliably"],
        ),
        (|all, _| all[4].kind = Publisher, "/r1/cmd_vel", Missing, &["nobody subscribes to it"]),
    ]
}

/// Who else is there.
fn company() -> Vec<GraphCase> {
    use EndpointKind::{Publisher, Subscription};
    use Readiness::{Doubtful, Missing};
    vec![
        (
            |all, _| add(all, Subscription, "/r1/cmd_vel", TwistMsg::TYPE),
            "/r1/cmd_vel",
            Doubtful,
            &[
                "takes geometry_msgs/msg/TwistStamped",
                "takes geometry_msgs/msg/Twist,",
                "only the first",
                "enable_stamped",
            ],
        ),
        (
            |all, _| all[4].hash = "RIHS01_0123".to_owned(),
            "/r1/cmd_vel",
            Missing,
            &["of another definition (its hash is RIHS01_0123)", "--distribution"],
        ),
        (
            |all, _| add(all, Publisher, "/r1/cmd_vel", TwistStamped::TYPE),
            "/r1/cmd_vel",
            Doubtful,
            &["/r1/driver_r1_cmd_vel may drive as well: end it", "--drive nav2"],
        ),
        (
            |all, _| add(all, Publisher, "/r1/map", OccupancyGridMsg::TYPE),
            "/r1/map",
            Doubtful,
            &["/r1/driver_r1_map publishes it already", "end it (slam_toolbox, AMCL"],
        ),
        (
            |all, _| add(all, Publisher, "/clock", ClockMsg::TYPE),
            "/clock",
            Doubtful,
            &["/r1/driver_clock tells a simulated time: say --use-sim-time"],
        ),
        (|_, config| config.use_sim_time = true, "/clock", Missing, &["nobody publishes it (rosgraph_msgs/msg/Clock)"]),
        (
            |all, config| {
                config.use_sim_time = true;
                add(all, Publisher, "/clock", ClockMsg::TYPE);
                again(all, 5);
            },
            "/clock",
            Doubtful,
            &["/other publish it"],
        ),
        (
            |all, config| {
                config.odometry = "tf".to_owned();
                all.retain(|end| end.name != "/r1/tf");
            },
            "/r1/tf",
            Missing,
            &["nobody publishes it (tf2_msgs/msg/TFMessage)"],
        ),
    ]
}
