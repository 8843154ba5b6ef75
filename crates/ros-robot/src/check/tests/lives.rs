//! What goes wrong while a robot runs.

use super::{LifeCase, MS, Running, TODAY};
use crate::config::RosRobotConfig;
use fht_perception::pose::pose;
use fht_ros_frames::{BandConfig, header_message, pose_message};
use fht_ros_messages::msg::{LaserScanMsg, OdometryMsg, Pose, Quaternion, Time};

fn plain(_: &mut RosRobotConfig) {}

fn sim_time(config: &mut RosRobotConfig) {
    config.use_sim_time = true;
}

fn points(config: &mut RosRobotConfig) {
    config.points = Some("points".to_owned());
}

/// What a robot is told, what happens, and words of what it says.
pub(super) fn lives() -> Vec<LifeCase> {
    let mut all = silences();
    all.extend(frames());
    all.extend(scans());
    all.extend(stamps());
    all.extend(clocks());
    all.extend(clouds());
    all.extend(super::seen::seen());
    all
}

fn silences() -> Vec<LifeCase> {
    vec![
        (plain, |_| {}, &["nothing has come on /r1/scan (sensor_msgs/LaserScan)", "/r1/odom (nav_msgs/Odometry)"]),
        (plain, |now| now.odometry(|_| {}), &["nothing has come on /r1/scan", "does its driver run"]),
        (plain, |now| now.scan(|_| {}), &["nothing has come on /r1/odom (nav_msgs/Odometry)", "does its driver run"]),
        (
            plain,
            |now| {
                now.odometry(|_| {});
                now.intake.take_scan(LaserScanMsg::default(), 0.15, TODAY * 1000);
            },
            &["/r1/scan has been silent for 0.8 s", "ros2 topic hz /r1/scan"],
        ),
        (
            plain,
            |now| {
                now.intake.take_odometry(&OdometryMsg::default(), 0.15, TODAY * 1000);
                now.scan(|_| {});
            },
            &["/r1/odom has been silent for 0.8 s", "ros2 topic hz /r1/odom"],
        ),
        (points, |now| now.odometry(|_| {}), &["nothing has come on /r1/points (sensor_msgs/PointCloud2)"]),
        (
            |config| config.odometry = "tf".to_owned(),
            |now| {
                now.laser();
                now.link("odom_combined", "base_link", Pose::default());
                now.scan(|_| {});
            },
            &["no transform leads from odom to the robot on /r1/tf", "odom_frame in [ros]", "odom_combined"],
        ),
    ]
}

fn frames() -> Vec<LifeCase> {
    vec![
        (plain, Running::both, &["no transform leads from base_link to laser", "/r1/scan", "no frames at all"]),
        (
            plain,
            |now| {
                now.link("base_link", "camera", Pose::default());
                now.both();
            },
            &[
                "no transform leads from base_link to laser",
                "publish it on tf_static",
                "frames there: base_link, camera",
            ],
        ),
        (
            |config| config.base_frame = Some("base_footprint".to_owned()),
            |now| {
                now.laser();
                now.both();
            },
            &["no transform leads from base_footprint to laser", "static_transform_publisher"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.scan(|scan| scan.header.frame_id.clear());
            },
            &["/r1/scan has no frame: set frame_id"],
        ),
        (
            plain,
            |now| {
                let half = std::f64::consts::FRAC_1_SQRT_2;
                let orientation = Quaternion { x: half, y: 0.0, z: 0.0, w: half };
                now.link("base_link", "laser", Pose { orientation, ..Pose::default() });
                now.both();
            },
            &["the scanner laser is tilted by 90°", "correct its transform on tf_static", "--points"],
        ),
        (
            plain,
            |now| {
                now.link("base_link", "laser", pose_message(&pose(5000.0, 0.0, 0.0)));
                now.both();
            },
            &["the scans of /r1/scan make no sense"],
        ),
    ]
}

fn scans() -> Vec<LifeCase> {
    vec![
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.scan(|scan| scan.ranges.clear());
            },
            &["the scans of /r1/scan make no sense: see their angles and limits"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.scan(|scan| scan.angle_increment = 0.0);
            },
            &["the scans of /r1/scan make no sense"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.scan(|scan| scan.range_max = 0.0);
            },
            &["the scans of /r1/scan make no sense"],
        ),
        (
            plain,
            |now| {
                let none = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
                now.odometry(|odometry| odometry.pose.pose.orientation = none);
                now.intake.take_scan(LaserScanMsg::default(), 0.9, TODAY * 1000);
            },
            &["/r1/odom has poses that are none"],
        ),
        (
            plain,
            |now| {
                now.odometry(|odometry| odometry.pose.pose.position.x = f64::NAN);
                now.intake.take_scan(LaserScanMsg::default(), 0.9, TODAY * 1000);
            },
            &["/r1/odom has poses that are none"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.both();
                now.stamp_us += 100 * MS;
                now.odometry(|odometry| odometry.pose.pose.position.x = 70.0);
            },
            &["/r1/odom has jumped", "two robots publish it"],
        ),
    ]
}

fn stamps() -> Vec<LifeCase> {
    vec![
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.scan(|scan| scan.header = header_message(TODAY + 8_000 * MS, "laser"));
            },
            &["the stamps of /r1/scan are 8.0 s ahead of those of /r1/odom", "chrony", "use_sim_time"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|odometry| odometry.header = header_message(TODAY + 8_000 * MS, "odom"));
                now.scan(|_| {});
            },
            &["the stamps of /r1/scan are 8.0 s behind those of /r1/odom"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.scan(|_| {});
                now.odometry(|odometry| odometry.header = header_message(TODAY + 400 * MS, "odom"));
            },
            &["/r1/odom comes too late or too seldom for /r1/scan", "10 Hz"],
        ),
        (
            plain,
            |now| {
                now.scan(|_| {});
                now.scan(|scan| scan.header = header_message(TODAY - 8_000 * MS, "laser"));
                now.odometry(|_| {});
            },
            &["the stamps of /r1/scan have gone back by 8.0 s: do two robots publish it?", "start again"],
        ),
        (
            plain,
            |now| {
                now.odometry(|_| {});
                now.scan(|scan| scan.header.stamp = Time { sec: -5, nanosec: 0 });
            },
            &["/r1/scan has stamps that are no times"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|odometry| odometry.header.stamp = Time::default());
                now.scan(|scan| scan.header.stamp = Time::default());
            },
            &["/r1/scan has stamps of zero", "use_sim_time"],
        ),
        (
            plain,
            |now| {
                now.laser();
                now.odometry(|odometry| odometry.header = header_message(5_000 * MS, "odom"));
                now.scan(|scan| scan.header = header_message(5_000 * MS, "laser"));
            },
            &["the stamps of /r1/scan are of a simulated clock", "say --use-sim-time"],
        ),
    ]
}

fn clocks() -> Vec<LifeCase> {
    vec![
        (
            plain,
            |now| {
                now.scan(|scan| scan.header = header_message(TODAY - 3_600_000 * MS, "laser"));
            },
            &["the stamps of /r1/scan are of another clock: 3600.0 s behind this machine's", "chrony"],
        ),
        (
            plain,
            |now| {
                now.scan(|_| {});
                now.stamp_us += 5_000 * MS;
                now.scan(|scan| scan.header = header_message(TODAY + 100 * MS, "laser"));
            },
            &["the stamps of /r1/scan lag: its messages come 4.9 s later", "ros2 topic delay /r1/scan"],
        ),
        (
            plain,
            |now| {
                now.scan(|_| {});
                now.stamp_us += 100 * MS;
                now.scan(|scan| scan.header = header_message(TODAY + 5_100 * MS, "laser"));
            },
            &["the stamps of /r1/scan have jumped 5.0 s ahead", "chrony"],
        ),
        (sim_time, Running::both, &["nothing has come on /clock, which use_sim_time waits for", "ros2 bag play"]),
        (
            sim_time,
            |now| {
                now.clock(TODAY, 0.15);
                now.both();
            },
            &["/clock has stood still for 0.8 s: is the simulation paused"],
        ),
        (
            sim_time,
            |now| {
                now.clock(TODAY, 0.9);
                now.clock(TODAY - 60_000 * MS, 0.9);
            },
            &["/clock has gone back by 60.0 s: the simulation was reset", "start again"],
        ),
        (
            sim_time,
            |now| {
                now.clock(5_000 * MS, 0.9);
                now.both();
            },
            &["the stamps of /r1/scan are of another clock", "ahead of /clock; set use_sim_time for its node"],
        ),
    ]
}

fn clouds() -> Vec<LifeCase> {
    vec![
        (
            points,
            |now| {
                now.odometry(|_| {});
                now.points(|_| {});
            },
            &["no transform leads from base_link to laser, the frame of /r1/points"],
        ),
        (
            points,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.points(|cloud| drop(cloud.fields.pop()));
            },
            &["/r1/points is of no use: its points have no z", "ros2 topic echo --field fields"],
        ),
        (
            points,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.points(|cloud| cloud.fields[0].datatype = 4);
            },
            &["/r1/points is of no use: its x is not a float32 or float64"],
        ),
        (
            points,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.points(|cloud| cloud.width = 100);
            },
            &["/r1/points is of no use: it has 12 bytes where", "driver is at fault"],
        ),
        (
            points,
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.points(|cloud| (cloud.width, cloud.height) = (70_000, 70_000));
            },
            &["/r1/points is of no use", "are too many: thin it out (a voxel filter)"],
        ),
        (
            |config| {
                points(config);
                config.band = BandConfig { low_m: 2.0, ..BandConfig::default() };
            },
            |now| {
                now.laser();
                now.odometry(|_| {});
                now.points(|_| {});
            },
            &["/r1/points is of no use: the band of heights is empty", "see low_m"],
        ),
    ]
}
