//! From messages to frames: each scan with the odometry at its stamp, in the frame of the robot's
//! base. No I/O and no clock: times of arrival are given, seconds since any beginning.

use crate::config::RosRobotConfig;
use fht_perception::frame::SensorFrame;
use fht_perception::pose::pose;
use fht_ros_frames::{
    Mount, OdometryLimits, OdometryTrack, PoseLookup, PoseRefused, ScanConfig, TransformTree, frame_name, scan_of,
    yaw_of,
};
use fht_ros_messages::msg::{LaserScanMsg, OdometryMsg, Pose, TfMessage, Time};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Most scans that wait for their odometry.
const WAITING: usize = 8;
/// A scanner tilted by more than this does not see a level plane of the room, radians.
const TILT_LIMIT_RAD: f64 = 0.2;
/// Stamps that differ by more than this come from different clocks, seconds.
const OTHER_CLOCK_S: f64 = 1.0;

/// What became of the messages.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IntakeReport {
    /// Scans that came.
    pub scans: u64,
    /// Frames that came of them.
    pub frames: u64,
    /// Scans whose odometry did not come in time.
    pub frames_late: u64,
    /// Scans that were lost: dropped from a full queue, of no sense, without a transform, or older
    /// than the one before.
    pub frames_lost: u64,
    /// Odometry that cannot be used.
    pub odometry_refused: u64,
    /// How often the odometry was reset.
    pub odometry_jumps: u64,
}

/// When a sensor was heard of last.
#[derive(Clone, Copy, Debug, Default)]
struct Heard {
    arrived_s: Option<f64>,
    stamp_ns: Option<u64>,
}

/// Turns messages into frames, and knows what it lacks.
pub(crate) struct Intake {
    config: RosRobotConfig,
    /// Full names, for sentences.
    scan_topic: String,
    odometry_topic: String,
    tree: TransformTree,
    track: OdometryTrack,
    base_frame: Option<String>,
    waiting: VecDeque<(f64, u64, LaserScanMsg)>,
    last_ns: Option<u64>,
    scan: Heard,
    odometry: Heard,
    /// What keeps scans from becoming frames.
    obstacle: Option<String>,
    report: IntakeReport,
}

impl Intake {
    pub(crate) fn new(config: RosRobotConfig, scan_topic: &str, odometry_topic: &str) -> Self {
        Self {
            scan_topic: scan_topic.to_owned(),
            odometry_topic: odometry_topic.to_owned(),
            tree: TransformTree::default(),
            track: OdometryTrack::new(OdometryLimits::default()),
            base_frame: config.base_frame.clone(),
            waiting: VecDeque::new(),
            last_ns: None,
            scan: Heard::default(),
            odometry: Heard::default(),
            obstacle: None,
            report: IntakeReport::default(),
            config,
        }
    }

    pub(crate) fn report(&self) -> IntakeReport {
        IntakeReport { odometry_jumps: self.track.jumps(), ..self.report.clone() }
    }

    /// The newest stamp of the sensors: what time it is for the robot.
    pub(crate) fn newest(&self) -> Time {
        let newest = self.scan.stamp_ns.max(self.odometry.stamp_ns).unwrap_or_default();
        Time::from_us(newest / 1000)
    }

    /// The robot's frame.
    pub(crate) fn base_frame(&self) -> String {
        self.base_frame.clone().unwrap_or_else(|| "base_link".to_owned())
    }

    /// How long a sensor may say nothing, seconds.
    pub(crate) fn silent_after_s(&self) -> f64 {
        self.config.silent_after_s
    }

    pub(crate) fn take_scan(&mut self, message: LaserScanMsg, arrived_s: f64, wall_ns: u64) {
        self.report.scans += 1;
        let stamp_ns = stamp_ns(message.header.stamp, wall_ns);
        self.scan = Heard { arrived_s: Some(arrived_s), stamp_ns };
        let Some(stamp_ns) = stamp_ns else {
            return self.lose(format!("{} has stamps that are no times", self.scan_topic));
        };
        // Frames have microsecond stamps.
        if let Some(last_ns) = self.last_ns
            && stamp_ns / 1000 <= last_ns / 1000
        {
            let back_s = (last_ns - stamp_ns.min(last_ns)) as f64 * 1e-9;
            let sentence = format!(
                "the stamps of {} have gone back by {back_s:.1} s: do two robots publish it? if its clock was set back, \
                 start again",
                self.scan_topic
            );
            return if back_s > OTHER_CLOCK_S { self.lose(sentence) } else { self.report.frames_lost += 1 };
        }
        self.last_ns = Some(stamp_ns);
        self.waiting.push_back((arrived_s, stamp_ns, message));
        if self.waiting.len() > WAITING {
            self.waiting.pop_front();
            self.report.frames_lost += 1;
        }
    }

    pub(crate) fn take_odometry(&mut self, message: &OdometryMsg, arrived_s: f64, wall_ns: u64) {
        if self.base_frame.is_none() && !message.child_frame_id.is_empty() {
            self.base_frame = Some(frame_name(&message.child_frame_id).to_owned());
        }
        self.take_pose(message.header.stamp, &message.pose.pose, arrived_s, wall_ns);
    }

    fn take_pose(&mut self, stamp: Time, at: &Pose, arrived_s: f64, wall_ns: u64) {
        let stamp = stamp_ns(stamp, wall_ns);
        self.odometry = Heard { arrived_s: Some(arrived_s), stamp_ns: stamp };
        let odom_from_base = yaw_of(&at.orientation).map(|yaw| pose(at.position.x, at.position.y, yaw));
        let (Some(stamp), Some(odom_from_base)) = (stamp, odom_from_base) else {
            self.report.odometry_refused += 1;
            self.obstacle = Some(format!("{} has poses that are none", self.odometry_topic));
            return;
        };
        match self.track.push(stamp, odom_from_base) {
            // The same once more, as several publishers of transforms make it.
            Ok(()) | Err(PoseRefused::NotNewer) => {}
            Err(PoseRefused::Unusable) => {
                self.report.odometry_refused += 1;
                self.obstacle = Some(format!("{} has poses that are none", self.odometry_topic));
            }
        }
    }

    pub(crate) fn take_transforms(&mut self, message: &TfMessage, arrived_s: f64, wall_ns: u64) {
        for stamped in &message.transforms {
            let (parent, child) = (frame_name(&stamped.header.frame_id), frame_name(&stamped.child_frame_id));
            let is_odometry = self.config.has_odometry_in_tf()
                && parent == frame_name(&self.config.odom_frame)
                && self.base_frame.as_ref().is_none_or(|base| frame_name(base) == child);
            if self.tree.insert(stamped) && is_odometry {
                self.base_frame = Some(child.to_owned());
                self.take_pose(stamped.header.stamp, &stamped.transform, arrived_s, wall_ns);
            }
        }
    }

    /// `count` scans were dropped before they came here.
    pub(crate) fn lose_scans(&mut self, count: u64) {
        self.report.frames_lost += count;
    }

    fn lose(&mut self, why: String) {
        self.report.frames_lost += 1;
        self.obstacle = Some(why);
    }

    /// The newest frame that is complete at `now_s`; older ones are lost.
    pub(crate) fn frame(&mut self, now_s: f64) -> Option<SensorFrame> {
        let mut newest = None;
        while let Some((arrived_s, stamp_ns, message)) = self.waiting.pop_front() {
            let odom_from_base = match self.track.pose_at(stamp_ns) {
                PoseLookup::Known(pose) => pose,
                PoseLookup::Later if now_s - arrived_s <= self.config.patience_s => {
                    self.waiting.push_front((arrived_s, stamp_ns, message));
                    break;
                }
                PoseLookup::Later | PoseLookup::Before | PoseLookup::Gap => {
                    self.report.frames_late += 1;
                    self.obstacle = Some(self.stamps_apart());
                    continue;
                }
            };
            let base = self.base_frame();
            let sensor = frame_name(&message.header.frame_id).to_owned();
            let Some(base_from_sensor) = self.tree.base_from(&base, &sensor) else {
                self.lose(self.no_transform(&base, &sensor));
                continue;
            };
            let mount = Mount::of(&base_from_sensor);
            if mount.tilt_rad > TILT_LIMIT_RAD {
                let tilt = mount.tilt_rad.to_degrees();
                self.lose(format!("the scanner {sensor} is tilted by {tilt:.0}°: its scans are not level"));
                continue;
            }
            let Some(scan) = scan_of(&message, &mount, &ScanConfig::default()) else {
                let topic = self.scan_topic.clone();
                self.lose(format!("the scans of {topic} make no sense: see their angles and limits (ros2 topic echo)"));
                continue;
            };
            let frame = SensorFrame { time_us: stamp_ns / 1000, odom_from_base, scan, panorama: None };
            if newest.replace(frame).is_some() {
                self.report.frames_lost += 1;
            }
        }
        if newest.is_some() {
            self.report.frames += 1;
            self.obstacle = None;
        }
        newest
    }

    fn no_transform(&self, base: &str, sensor: &str) -> String {
        let there = self.tree.frames().join(", ");
        let there = if there.is_empty() { "no frames at all".to_owned() } else { format!("frames there: {there}") };
        format!(
            "no transform leads from {base} to {sensor}, the frame of {}: publish it on {} (robot_state_publisher, or \
             static_transform_publisher); {there}",
            self.scan_topic, self.config.tf_static
        )
    }

    /// Why scans have no odometry.
    fn stamps_apart(&self) -> String {
        let (scan, odometry) = (&self.scan_topic, &self.odometry_topic);
        let apart_s = match (self.scan.stamp_ns, self.odometry.stamp_ns) {
            (Some(scan_ns), Some(odometry_ns)) => (scan_ns as f64 - odometry_ns as f64) * 1e-9,
            _ => return self.silence(odometry, "nav_msgs/Odometry", None),
        };
        if apart_s.abs() > OTHER_CLOCK_S {
            let side = if apart_s > 0.0 { "ahead of" } else { "behind" };
            format!(
                "the stamps of {scan} are {:.1} s {side} those of {odometry}: set their clocks by the same source (chrony), \
                 or use_sim_time for both",
                apart_s.abs()
            )
        } else {
            format!("{odometry} comes too late or too seldom for {scan}: it should come at 10 Hz at least")
        }
    }

    fn silence(&self, topic: &str, kind: &str, for_s: Option<f64>) -> String {
        match for_s {
            Some(for_s) => {
                format!("{topic} has been silent for {for_s:.1} s: does its driver run? (ros2 topic hz {topic})")
            }
            None => format!("nothing has come on {topic} ({kind}): does its driver run, in this domain and namespace?"),
        }
    }

    /// What keeps frames from coming, at `now_s`: a sentence that names the topic.
    pub(crate) fn trouble(&self, now_s: f64) -> Option<String> {
        let limit_s = self.config.silent_after_s;
        let odometry_type = if self.config.has_odometry_in_tf() { "tf2_msgs/TFMessage" } else { "nav_msgs/Odometry" };
        let sensors = [
            (&self.scan_topic, "sensor_msgs/LaserScan", self.scan),
            (&self.odometry_topic, odometry_type, self.odometry),
        ];
        let silent: Vec<String> = sensors
            .into_iter()
            .filter_map(|(topic, kind, heard)| match heard.arrived_s {
                None => Some(self.silence(topic, kind, None)),
                Some(arrived_s) if now_s - arrived_s >= limit_s => {
                    Some(self.silence(topic, kind, Some(now_s - arrived_s)))
                }
                Some(_) => None,
            })
            .collect();
        if silent.is_empty() { self.obstacle.clone() } else { Some(silent.join("; ")) }
    }
}

/// A stamp in nanoseconds; where it was left at zero, the time of arrival.
fn stamp_ns(stamp: Time, wall_ns: u64) -> Option<u64> {
    stamp.nanoseconds().map(|ns| if ns == 0 { wall_ns } else { ns })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_frames::{header_message, pose_message};
    use fht_ros_messages::msg::{PoseWithCovariance, TransformStamped};

    const MS: u64 = 1000;

    fn intake() -> Intake {
        Intake::new(RosRobotConfig::default(), "/r1/scan", "/r1/odom")
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
    fn odometry_may_come_in_transforms() {
        let config = RosRobotConfig { odometry: "/tf".to_owned(), ..RosRobotConfig::default() };
        let mut intake = Intake::new(config, "/scan", "/tf");
        intake.take_transforms(&transform("base_footprint", "laser", 0.0, 1), 0.0, 0);
        intake.take_transforms(&transform("map", "odom", 5.0, 1000 * MS), 0.0, 0);
        intake.take_transforms(&transform("odom", "base_footprint", 2.0, 1000 * MS), 0.0, 0);
        intake.take_scan(scan(1000 * MS), 0.0, 0);
        assert_eq!(intake.frame(0.0).map(|frame| frame.odom_from_base), Some(pose(2.0, 0.0, 0.0)));
    }

    /// What is said once a second has passed.
    fn said(fill: impl FnOnce(&mut Intake)) -> String {
        let mut intake = intake();
        fill(&mut intake);
        assert!(intake.frame(1.0).is_none());
        intake.trouble(1.0).expect("something is wrong")
    }

    #[test]
    fn what_keeps_frames_from_coming_is_a_sentence_that_names_the_topic() {
        let laser = transform("base_link", "laser", 0.0, 1);
        let cases: [(String, &[&str]); 7] = [
            (said(|_| {}), &["nothing has come on /r1/scan (sensor_msgs/LaserScan)", "/r1/odom (nav_msgs/Odometry)"]),
            (
                said(|intake| intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0)),
                &["nothing has come on /r1/scan", "does its driver run"],
            ),
            (
                said(|intake| {
                    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0);
                    intake.take_scan(scan(1000 * MS), 0.2, 0);
                }),
                &["/r1/scan has been silent for 0.8 s", "ros2 topic hz"],
            ),
            (
                said(|intake| {
                    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0);
                    intake.take_scan(scan(1000 * MS), 0.9, 0);
                }),
                &["no transform leads from base_link to laser", "tf_static", "static_transform_publisher"],
            ),
            (
                said(|intake| {
                    intake.take_transforms(&laser, 0.0, 0);
                    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0);
                    intake.take_scan(scan(9000 * MS), 0.68, 0);
                }),
                &["the stamps of /r1/scan are 8.0 s ahead of those of /r1/odom", "chrony", "use_sim_time"],
            ),
            (
                said(|intake| {
                    intake.take_transforms(&laser, 0.0, 0);
                    intake.take_odometry(&odometry(9000 * MS, 0.0), 0.9, 0);
                    intake.take_scan(scan(1000 * MS), 0.68, 0);
                }),
                &["the stamps of /r1/scan are 8.0 s behind those of /r1/odom"],
            ),
            (
                said(|intake| {
                    intake.take_transforms(&laser, 0.0, 0);
                    intake.take_odometry(&odometry(1000 * MS, 0.0), 0.9, 0);
                    intake.take_scan(LaserScanMsg { ranges: vec![], ..scan(1000 * MS) }, 0.9, 0);
                }),
                &["the scans of /r1/scan make no sense"],
            ),
        ];
        for (said, wanted) in cases {
            for part in wanted {
                assert!(said.contains(part), "'{said}' should say '{part}'");
            }
        }
    }

    #[test]
    fn a_clock_that_is_set_back_is_told() {
        let mut intake = intake();
        intake.take_odometry(&odometry(9000 * MS, 0.0), 0.0, 0);
        intake.take_scan(scan(9000 * MS), 0.0, 0);
        intake.take_scan(scan(1000 * MS), 0.1, 0);
        assert!(
            intake.trouble(0.1).is_some_and(|said| said.contains("have gone back by 8.0 s: do two robots publish it?"))
        );
    }

    #[test]
    fn stamps_of_zero_are_the_time_of_arrival() {
        let mut intake = intake();
        intake.take_transforms(&transform("base_link", "laser", 0.0, 0), 0.0, 0);
        intake.take_odometry(&odometry(0, 0.0), 0.0, 7_000_000);
        intake.take_scan(scan(0), 0.0, 7_000_000);
        assert_eq!(intake.frame(0.0).map(|frame| frame.time_us), Some(7000));
    }
}
