use super::*;
use fht_ros_frames::{header_message, pose_message};
use fht_ros_messages::msg::{PointField, PoseWithCovariance, TransformStamped};

const MS: u64 = 1000;

fn intake() -> Intake {
    Intake::new(RosRobotConfig::default(), "/r1/scan", "/r1/odom", "/clock")
}

fn scan(time_us: u64) -> LaserScanMsg {
    LaserScanMsg {
        header: header_message(time_us, "laser"),
        angle_increment: 0.1,
        range_min: 0.1,
        range_max: 8.0,
        ranges: vec![1.0; 60],
        ..LaserScanMsg::default()
    }
}

fn odometry(time_us: u64, x: f64) -> OdometryMsg {
    OdometryMsg {
        header: header_message(time_us, "odom"),
        child_frame_id: "base_link".to_owned(),
        pose: PoseWithCovariance { pose: pose_message(&pose(x, 0.0, 0.0)), ..Default::default() },
        ..OdometryMsg::default()
    }
}

fn transform(parent: &str, child: &str, x: f64, time_us: u64) -> TfMessage {
    let transform = pose_message(&pose(x, 0.0, 0.0));
    let stamped =
        TransformStamped { header: header_message(time_us, parent), child_frame_id: child.to_owned(), transform };
    TfMessage { transforms: vec![stamped] }
}

#[test]
fn a_scan_waits_for_its_odometry_and_has_it_interpolated() {
    let mut intake = intake();
    intake.take_transforms(&transform("base_link", "laser", 0.2, 1), 0.0, 0);
    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.0, 0);
    intake.take_scan(scan(1050 * MS), 0.05, 0);
    assert!(intake.frame(0.06).is_none(), "its odometry has not come");
    intake.take_odometry(&odometry(1100 * MS, 1.0), 0.1, 0);
    let frame = intake.frame(0.1).expect("it is complete");
    assert_eq!((frame.time_us, frame.odom_from_base), (1050 * MS, pose(0.5, 0.0, 0.0)));
    assert_eq!(frame.scan.base_from_sensor, pose(0.2, 0.0, 0.0));
    assert!(frame.check().is_ok() && intake.trouble(0.2).is_none());
    assert_eq!(intake.report(), IntakeReport { scans: 1, frames: 1, ..IntakeReport::default() });
}

#[test]
fn the_newest_of_several_is_taken() {
    let mut intake = intake();
    intake.take_transforms(&transform("base_link", "laser", 0.0, 1), 0.0, 0);
    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.0, 0);
    for step in 1..=3 {
        intake.take_scan(scan((1000 + step * 100) * MS), 0.1, 0);
    }
    intake.take_scan(scan(1300 * MS), 0.1, 0);
    intake.take_odometry(&odometry(1300 * MS, 1.0), 0.1, 0);
    assert_eq!(intake.frame(0.1).map(|frame| frame.time_us), Some(1300 * MS));
    assert_eq!((intake.report().frames, intake.report().frames_lost), (1, 3));
}

#[test]
fn who_only_listens_gets_one_after_the_other() {
    let mut intake =
        Intake::new(RosRobotConfig { backlog: 20, ..RosRobotConfig::default() }, "/scan", "/odom", "/clock");
    intake.take_transforms(&transform("base_link", "laser", 0.0, 1), 0.0, 0);
    for step in 0..25 {
        intake.take_odometry(&odometry((1000 + step * 100) * MS, 0.0), 0.0, 0);
        intake.take_scan(scan((1000 + step * 100) * MS), 0.1, 0);
    }
    // What is more than may wait is lost, the oldest first.
    let times: Vec<u64> = std::iter::from_fn(|| intake.frame(0.1)).map(|frame| frame.time_us / MS).collect();
    assert_eq!(times, (5..25).map(|step| 1000 + step * 100).collect::<Vec<u64>>());
    assert_eq!((intake.report().frames, intake.report().frames_lost), (20, 5));
}

#[test]
fn what_was_lost_on_the_way_is_counted_and_what_comes_late_after_all_is_not() {
    let mut intake = intake();
    intake.lose_scans(2);
    intake.set_missed(5);
    assert_eq!(intake.report().frames_lost, 7);
    intake.set_missed(4);
    assert_eq!(intake.report().frames_lost, 6);
}

#[test]
fn short_gaps_are_told_of_a_robot_that_is_driven_and_of_no_other() {
    let told_after_s = |others_drive, silent_after_s| {
        let config = RosRobotConfig { others_drive, silent_after_s, ..RosRobotConfig::default() };
        Intake::new(config, "/scan", "/odom", "/clock").told_after_s()
    };
    assert_eq!((told_after_s(false, 0.35), told_after_s(true, 0.35), told_after_s(true, 5.0)), (0.35, 2.0, 5.0));
}

#[test]
fn odometry_may_come_in_transforms() {
    let config = RosRobotConfig { odometry: "/tf".to_owned(), ..RosRobotConfig::default() };
    let mut intake = Intake::new(config, "/scan", "/tf", "/clock");
    intake.take_transforms(&transform("base_footprint", "laser", 0.0, 1), 0.0, 0);
    intake.take_transforms(&transform("map", "odom", 5.0, 1000 * MS), 0.0, 0);
    intake.take_transforms(&transform("odom", "base_footprint", 2.0, 1000 * MS), 0.0, 0);
    intake.take_scan(scan(1000 * MS), 0.0, 0);
    assert_eq!(intake.frame(0.0).map(|frame| frame.odom_from_base), Some(pose(2.0, 0.0, 0.0)));
}

#[test]
fn stamps_of_zero_are_the_time_of_arrival() {
    let mut intake = intake();
    intake.take_transforms(&transform("base_link", "laser", 0.0, 0), 0.0, 0);
    intake.take_odometry(&odometry(0, 0.0), 0.0, 7_000_000);
    intake.take_scan(scan(0), 0.0, 7_000_000);
    assert_eq!(intake.frame(0.0).map(|frame| frame.time_us), Some(7000));
}

fn clock(time_us: u64) -> ClockMsg {
    ClockMsg { clock: Time::from_us(time_us) }
}

fn by_clock() -> Intake {
    let config = RosRobotConfig { use_sim_time: true, ..RosRobotConfig::default() };
    let mut intake = Intake::new(config, "/r1/scan", "/r1/odom", "/clock");
    intake.take_transforms(&transform("base_link", "laser", 0.0, 1), 0.0, 0);
    intake
}

#[test]
fn a_topic_tells_the_time_if_it_is_to() {
    let mut intake = by_clock();
    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.0, 0);
    intake.take_scan(scan(1000 * MS), 0.0, 0);
    assert!(intake.frame(0.0).is_none());
    assert!(intake.trouble(0.1).is_some_and(|said| said.contains("nothing has come on /clock, which use_sim_time")));
    intake.take_clock(&clock(1100 * MS), 0.2);
    intake.take_odometry(&odometry(1100 * MS, 0.0), 0.2, 0);
    intake.take_scan(scan(1100 * MS), 0.2, 0);
    assert_eq!(intake.frame(0.2).map(|frame| frame.time_us), Some(1100 * MS));
    assert!(intake.take_doubts().is_empty() && intake.trouble(0.3).is_none());
    // A stamp of zero is the time that is told.
    intake.take_clock(&clock(1200 * MS), 0.3);
    intake.take_odometry(&odometry(0, 0.0), 0.3, 0);
    intake.take_scan(scan(0), 0.3, 0);
    assert_eq!(intake.frame(0.3).map(|frame| frame.time_us), Some(1200 * MS));
    assert!(intake.trouble(2.0).is_some_and(|said| said.contains("/clock has stood still for 1.7 s")));
    assert!(intake.ended().is_none());
    intake.take_clock(&clock(5 * MS), 2.0);
    assert!(intake.ended().is_some_and(|said| said.contains("/clock has gone back by 1.2 s")));
    let doubts = intake.take_doubts();
    assert!(doubts[0].contains("/r1/scan has stamps of zero"), "{doubts:?}");
    assert!(doubts[1].contains("/clock has gone back by 1.2 s"), "{doubts:?}");
}

#[test]
fn what_comes_after_a_pause_of_the_clock_does_not_lag() {
    for is_paused in [true, false] {
        let mut intake = by_clock();
        intake.take_clock(&clock(1000 * MS), 0.0);
        intake.take_odometry(&odometry(1000 * MS, 0.0), 0.0, 0);
        intake.take_scan(scan(1000 * MS), 0.0, 0);
        // The clock is that of the newest message, and others came before it.
        let went_on_s = if is_paused { 5.0 } else { 0.2 };
        intake.take_clock(&clock(4000 * MS), went_on_s);
        intake.take_odometry(&odometry(1100 * MS, 0.0), went_on_s, 0);
        intake.take_scan(scan(1100 * MS), went_on_s, 0);
        let doubts = intake.take_doubts();
        assert_eq!(doubts.is_empty(), is_paused, "{doubts:?}");
        assert!(doubts.iter().all(|doubt| doubt.contains(" lag: its messages come 2.9 s later")), "{doubts:?}");
    }
}

#[test]
fn scans_of_another_clock_than_the_one_that_is_told_make_no_frames() {
    let mut intake = by_clock();
    intake.take_clock(&clock(1000 * MS), 0.9);
    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0);
    intake.take_scan(scan(1_800_000_000_000_000), 0.9, 0);
    assert!(intake.frame(0.9).is_none());
    let said = intake.trouble(1.0).expect("a sentence");
    assert!(
        said.contains("the stamps of /r1/scan are of another clock") && said.contains("set use_sim_time"),
        "{said}"
    );
}

#[test]
fn what_is_odd_about_stamps_is_told_and_frames_come() {
    let today_us = 1_800_000_000_000_000;
    let mut intake = intake();
    intake.take_transforms(&transform("base_link", "laser", 0.0, 1), 0.0, 0);
    let mut said = Vec::new();
    // The third comes three seconds late.
    for (step, late_us) in [(0, 10_000), (1, 20_000), (2, 3_000_000)] {
        let stamp_us = today_us + step * 100_000;
        let wall_ns = (stamp_us + late_us) * 1000;
        intake.take_odometry(&odometry(stamp_us, 0.0), 0.1, wall_ns);
        intake.take_scan(scan(stamp_us), 0.1, wall_ns);
        assert!(intake.frame(0.1).is_some(), "step {step}");
        said.extend(intake.take_doubts());
    }
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(
        said[1].contains("the stamps of /r1/scan lag") && said[1].contains("ros2 topic delay /r1/scan"),
        "{said:?}"
    );
}

#[test]
fn clouds_of_points_become_scans_once_their_sensor_is_known() {
    let config = RosRobotConfig { points: Some("points".to_owned()), ..RosRobotConfig::default() };
    let mut intake = Intake::new(config, "/points", "/odom", "/clock");
    assert!(
        intake.trouble(1.0).is_some_and(|said| said.contains("nothing has come on /points (sensor_msgs/PointCloud2)"))
    );
    let data: Vec<u8> = [2.0_f32, 0.0, 0.3].iter().flat_map(|value| value.to_le_bytes()).collect();
    let field =
        |(index, name): (u32, &str)| PointField { name: name.to_owned(), offset: 4 * index, datatype: 7, count: 1 };
    let cloud = |time_us: u64, fields: usize| PointCloud2 {
        header: header_message(time_us, "laser"),
        height: 1,
        width: 1,
        fields: (0..).zip(["x", "y", "z"]).take(fields).map(field).collect(),
        point_step: 12,
        row_step: 12,
        data: &data,
        ..PointCloud2::default()
    };
    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0);
    intake.take_points(&cloud(1000 * MS, 3), 0.9, 0);
    assert!(intake.frame(0.9).is_none());
    assert!(
        intake
            .trouble(1.0)
            .is_some_and(|said| said.contains("no transform leads from base_link to laser, the frame of /points"))
    );
    intake.take_transforms(&transform("base_link", "laser", 0.5, 1), 0.0, 0);
    intake.take_odometry(&odometry(1100 * MS, 1.0), 1.0, 0);
    intake.take_points(&cloud(1100 * MS, 3), 1.0, 0);
    let frame = intake.frame(1.0).expect("it is complete");
    assert!(frame.check().is_ok());
    let ends = frame.scan.points_in_base();
    assert!(ends.len() == 1 && (ends[0].x - 2.5).abs() < 0.01, "{ends:?}");
    intake.take_points(&cloud(1200 * MS, 2), 1.1, 0);
    assert!(intake.frame(1.1).is_none());
    assert!(intake.trouble(1.2).is_some_and(|said| said.contains("/points is of no use: its points have no z")));
    assert_eq!((intake.report().scans, intake.report().frames, intake.report().frames_lost), (3, 1, 2));
}
