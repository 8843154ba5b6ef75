//! From messages to frames: each scan with the odometry at its stamp, in the frame of the robot's
//! base. No I/O and no clock: times of arrival are given, seconds since any beginning.

use crate::clock::Reference;
use crate::config::RosRobotConfig;
use crate::pictures::Pictures;
use crate::stamps::{Stamped, Stamps, stamp_ns};
use fht_perception::frame::{LaserScan, SensorFrame};
use fht_perception::pose::pose;
use fht_ros_frames::{
    Mount, OdometryLimits, OdometryTrack, PoseLookup, PoseRefused, ScanConfig, TransformTree, frame_name, scan_of,
    scan_of_points, yaw_of,
};
use fht_ros_messages::msg::{CameraInfoMsg, ClockMsg, LaserScanMsg, OdometryMsg, PointCloud2, Pose, TfMessage, Time};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Most scans that wait for their odometry, beside those that may wait for their turn.
const WAITING: usize = 8;
/// A scanner tilted by more than this does not see a level plane of the room, radians.
const TILT_LIMIT_RAD: f64 = 0.2;
/// Stamps that differ by more than this come from different clocks, seconds.
const OTHER_CLOCK_S: f64 = 1.0;

/// Where others drive the robot, it is told what keeps frames from coming after this, seconds.
const OTHERS_GAP_S: f64 = 2.0;

/// What became of the messages.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IntakeReport {
    /// Scans that came.
    pub scans: u64,
    /// Frames that came of them.
    pub frames: u64,
    /// Frames with a panorama of the cameras' pictures.
    pub panoramas: u64,
    /// Scans whose odometry did not come in time.
    pub frames_late: u64,
    /// Scans that were lost: on the way here (by the numbers that the publisher gives them, if it
    /// does), dropped from a full queue, of no sense, without a transform, or older than the one
    /// before.
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

/// What the robot saw.
enum Sight {
    /// A scan, in the frame of its scanner.
    Message(LaserScanMsg),
    /// A scan that was made of a cloud of points, in the robot's frame.
    Made(LaserScan),
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
    waiting: VecDeque<(f64, u64, Sight)>,
    /// Complete frames, oldest first.
    ready: VecDeque<SensorFrame>,
    last_ns: Option<u64>,
    scan: Heard,
    odometry: Heard,
    stamps: Stamps,
    /// None: the robot has no cameras, or they are not used.
    pictures: Option<Pictures>,
    /// What keeps scans from becoming frames.
    obstacle: Option<String>,
    /// Scans that have not come here.
    missed: u64,
    report: IntakeReport,
}

impl Intake {
    /// Of these topics, by their full names; `clock_topic` is the one that tells the time.
    pub(crate) fn new(config: RosRobotConfig, scan_topic: &str, odometry_topic: &str, clock_topic: &str) -> Self {
        Self {
            stamps: Stamps::new(&config, scan_topic, odometry_topic, clock_topic),
            pictures: None,
            scan_topic: scan_topic.to_owned(),
            odometry_topic: odometry_topic.to_owned(),
            tree: TransformTree::default(),
            track: OdometryTrack::new(OdometryLimits::default()),
            base_frame: config.base_frame.clone(),
            waiting: VecDeque::new(),
            ready: VecDeque::new(),
            last_ns: None,
            scan: Heard::default(),
            odometry: Heard::default(),
            obstacle: None,
            missed: 0,
            report: IntakeReport::default(),
            config,
        }
    }

    /// With the pictures of four cameras.
    pub(crate) fn with_pictures(self, pictures: Pictures) -> Self {
        Self { pictures: Some(pictures), ..self }
    }

    pub(crate) fn report(&self) -> IntakeReport {
        let frames_lost = self.report.frames_lost.saturating_add(self.missed);
        IntakeReport { odometry_jumps: self.track.jumps(), frames_lost, ..self.report.clone() }
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

    /// How long no frame may come before it is told why, seconds: a robot that this program drives
    /// stands then; where others drive, short gaps are nothing to tell of.
    pub(crate) fn told_after_s(&self) -> f64 {
        let silent_after_s = self.config.silent_after_s;
        if self.config.others_drive { silent_after_s.max(OTHERS_GAP_S) } else { silent_after_s }
    }

    /// The time is told.
    pub(crate) fn take_clock(&mut self, message: &ClockMsg, arrived_s: f64) {
        self.stamps.take_clock(message, arrived_s);
    }

    /// Why no frame that comes from here on fits to those before, if none does: a sentence.
    pub(crate) fn ended(&self) -> Option<String> {
        self.stamps.reset()
    }

    /// What is odd and was not told yet: sentences.
    pub(crate) fn take_doubts(&mut self) -> Vec<String> {
        let mut doubts = self.stamps.take_doubts();
        doubts.extend(self.pictures.as_mut().map(Pictures::take_doubts).unwrap_or_default());
        doubts
    }

    pub(crate) fn take_scan(&mut self, message: LaserScanMsg, arrived_s: f64, wall_ns: u64) {
        self.take_sight(message.header.stamp, Sight::Message(message), arrived_s, wall_ns);
    }

    /// A cloud of points becomes a scan at once: it is large. So the transform to its sensor must
    /// have come before.
    pub(crate) fn take_points(&mut self, cloud: &PointCloud2<'_>, arrived_s: f64, wall_ns: u64) {
        let (base, sensor) = (self.base_frame(), frame_name(&cloud.header.frame_id).to_owned());
        let Some(base_from_sensor) = self.tree.base_from(&base, &sensor) else {
            self.report.scans += 1;
            self.scan.arrived_s = Some(arrived_s);
            return self.lose(self.no_transform(&base, &sensor));
        };
        match scan_of_points(cloud, &base_from_sensor, &self.config.band) {
            Ok(scan) => self.take_sight(cloud.header.stamp, Sight::Made(scan), arrived_s, wall_ns),
            Err(refusal) => {
                self.report.scans += 1;
                self.scan.arrived_s = Some(arrived_s);
                self.lose(format!("{} is of no use: {refusal}", self.scan_topic));
            }
        }
    }

    fn take_sight(&mut self, stamp: Time, sight: Sight, arrived_s: f64, wall_ns: u64) {
        self.report.scans += 1;
        let now = self.stamps.now(wall_ns);
        let stamp_ns = stamp_ns(stamp, now);
        self.scan = Heard { arrived_s: Some(arrived_s), stamp_ns };
        let Some(now) = now else {
            // What is wrong is that nobody tells the time.
            self.report.frames_lost += 1;
            return;
        };
        let Some(stamp_ns) = stamp_ns else {
            return self.lose(format!("{} has stamps that are no times", self.scan_topic));
        };
        if stamp == Time::default() {
            self.stamps.doubt(format!(
                "{} has stamps of zero, and the time of arrival is taken: set its driver's clock, or start what its \
                 use_sim_time waits for",
                self.scan_topic
            ));
        }
        if let Some(refusal) = self.stamps.judge(stamp_ns, Stamped::Scan, now, arrived_s) {
            return self.lose(refusal);
        }
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
        self.waiting.push_back((arrived_s, stamp_ns, sight));
        if self.waiting.len() > self.config.backlog.saturating_add(WAITING) {
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
        let now = self.stamps.now(wall_ns);
        let stamp = stamp_ns(stamp, now);
        self.odometry = Heard { arrived_s: Some(arrived_s), stamp_ns: stamp };
        let Some(now) = now else { return };
        let refusal = stamp.and_then(|stamp_ns| self.stamps.judge(stamp_ns, Stamped::Odometry, now, arrived_s));
        if let Some(refusal) = refusal {
            self.report.odometry_refused += 1;
            self.obstacle = Some(refusal);
            return;
        }
        let odom_from_base = yaw_of(&at.orientation).map(|yaw| pose(at.position.x, at.position.y, yaw));
        let (Some(stamp), Some(odom_from_base)) = (stamp, odom_from_base) else {
            self.report.odometry_refused += 1;
            self.obstacle = Some(format!("{} has poses that are none", self.odometry_topic));
            return;
        };
        let jumps = self.track.jumps();
        match self.track.push(stamp, odom_from_base) {
            Ok(()) if self.track.jumps() > jumps => self.stamps.doubt(format!(
                "{} has jumped: it was reset, or two robots publish it (give each a namespace, or a router)",
                self.odometry_topic
            )),
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

    /// A picture of a camera, in CDR.
    pub(crate) fn take_picture(&mut self, camera: usize, bytes: Vec<u8>, arrived_s: f64, wall_ns: u64) {
        let now = self.stamps.now(wall_ns).map(|(Reference::Clock(ns) | Reference::Machine(ns))| ns);
        if let Some(pictures) = &mut self.pictures {
            pictures.take_picture(camera, bytes, arrived_s, now);
        }
    }

    /// How a camera looks.
    pub(crate) fn take_camera_info(&mut self, camera: usize, info: CameraInfoMsg) {
        if let Some(pictures) = &mut self.pictures {
            pictures.take_info(camera, info);
        }
    }

    /// `count` scans were dropped before they came here.
    pub(crate) fn lose_scans(&mut self, count: u64) {
        self.report.frames_lost += count;
    }

    /// So many scans have not come here so far: fewer, if some come late after all.
    pub(crate) fn set_missed(&mut self, missed: u64) {
        self.missed = missed;
    }

    fn lose(&mut self, why: String) {
        self.report.frames_lost += 1;
        self.obstacle = Some(why);
    }

    /// The oldest of the frames that are complete at `now_s`, of which only the newest `backlog`
    /// are kept.
    pub(crate) fn frame(&mut self, now_s: f64) -> Option<SensorFrame> {
        self.complete(now_s);
        while self.ready.len() > self.config.backlog.max(1) {
            self.ready.pop_front();
            self.report.frames_lost += 1;
        }
        let mut next = self.ready.pop_front()?;
        self.report.frames += 1;
        self.obstacle = None;
        let base = self.base_frame();
        if let Some(pictures) = &mut self.pictures {
            let stamp_ns = next.time_us.saturating_mul(1000);
            next.panorama = pictures.panorama(stamp_ns, now_s, &self.tree, &base, &self.scan_topic);
            self.report.panoramas += u64::from(next.panorama.is_some());
        }
        Some(next)
    }

    /// Makes frames of the scans whose odometry has come by `now_s`.
    fn complete(&mut self, now_s: f64) {
        while let Some((arrived_s, stamp_ns, sight)) = self.waiting.pop_front() {
            let odom_from_base = match self.track.pose_at(stamp_ns) {
                PoseLookup::Known(pose) => pose,
                PoseLookup::Later if now_s - arrived_s <= self.config.patience_s => {
                    self.waiting.push_front((arrived_s, stamp_ns, sight));
                    break;
                }
                PoseLookup::Later | PoseLookup::Before | PoseLookup::Gap => {
                    self.report.frames_late += 1;
                    self.obstacle = Some(self.stamps_apart());
                    continue;
                }
            };
            let scan = match sight {
                Sight::Made(scan) => Ok(scan),
                Sight::Message(message) => self.levelled(&message),
            };
            let scan = match scan {
                Ok(scan) => scan,
                Err(why) => {
                    self.lose(why);
                    continue;
                }
            };
            self.ready.push_back(SensorFrame { time_us: stamp_ns / 1000, odom_from_base, scan, panorama: None });
        }
    }

    /// A scan in the robot's frame; or why there is none.
    fn levelled(&self, message: &LaserScanMsg) -> Result<LaserScan, String> {
        let (base, sensor) = (self.base_frame(), frame_name(&message.header.frame_id));
        let base_from_sensor = self.tree.base_from(&base, sensor).ok_or_else(|| self.no_transform(&base, sensor))?;
        let mount = Mount::of(&base_from_sensor);
        if mount.tilt_rad > TILT_LIMIT_RAD {
            let tilt = mount.tilt_rad.to_degrees();
            return Err(format!(
                "the scanner {sensor} is tilted by {tilt:.0}°: its scans are not level; correct its transform on {}, or \
                 give its points (--points)",
                self.config.tf_static
            ));
        }
        scan_of(message, &mount, &ScanConfig::default()).ok_or_else(|| {
            format!("the scans of {} make no sense: see their angles and limits (ros2 topic echo)", self.scan_topic)
        })
    }

    fn no_transform(&self, base: &str, sensor: &str) -> String {
        if sensor.is_empty() {
            return format!("{} has no frame: set frame_id in the parameters of its driver", self.scan_topic);
        }
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
        // Where time stands still all else does, too.
        let time = self.stamps.trouble(now_s);
        if time.is_some() {
            return time;
        }
        let odometry_type = if self.config.has_odometry_in_tf() { "tf2_msgs/TFMessage" } else { "nav_msgs/Odometry" };
        let sensors = [
            (&self.scan_topic, self.config.sight().1, self.scan),
            (&self.odometry_topic, odometry_type, self.odometry),
        ];
        if self.odometry.arrived_s.is_none()
            && self.scan.arrived_s.is_some()
            && self.config.has_odometry_in_tf()
            && !self.tree.frames().is_empty()
        {
            let (frame, topic) = (&self.config.odom_frame, &self.odometry_topic);
            let there = self.tree.frames().join(", ");
            return Some(format!(
                "no transform leads from {frame} to the robot on {topic}: see odom_frame in [ros], or give --odom-topic; \
                 frames there: {there}"
            ));
        }
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

#[cfg(test)]
mod tests;
