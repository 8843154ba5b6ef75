//! Sensor frames from a bag.

use super::files::BagOpenError;
use super::log_order::LogOrder;
use super::report::{BagReport, Dropped};
use super::stream::{Broken, Messages};
use super::survey::{BagInfo, survey};
use super::topics::{Chosen, OdometrySource, TopicConfig, TopicError, choose};
use fht_perception::frame::SensorFrame;
use fht_perception::pose::{Pose2, pose};
use fht_perception::robot::{RobotError, Sensors};
use fht_ros_frames::{
    Mount, OdometryLimits, OdometryTrack, PanoramaCameras, PanoramaRefused, PictureMessage, PoseLookup, PoseRefused,
    ScanConfig, TransformTree,
};
use fht_ros_frames::{frame_name, scan_of, yaw_of};
use fht_ros_messages::RosMessage;
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{self, CompressedImage, Time};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::path::Path;

/// Most pictures of each camera that wait for their scan.
const PICTURES: usize = 16;
/// Most scans that wait for odometry and pictures.
const PENDING_LIMIT: usize = 512;
/// A scanner tilted by more than this does not see a level plane of the room, radians.
const TILT_LIMIT_RAD: f64 = 0.2;

/// How a bag becomes frames.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct FrameConfig {
    /// Topics.
    pub topics: TopicConfig,
    /// Scans.
    pub scan: ScanConfig,
    /// Odometry.
    pub odometry: OdometryLimits,
    /// The robot's frame. By default the child frame of the odometry, else `base_link`.
    pub base_frame: Option<String>,
    /// The frame that odometry transforms start from. `odom`.
    pub odom_frame: String,
    /// Largest time between a scan and the pictures that belong to it, seconds. 0.05.
    pub picture_tolerance_s: f64,
    /// How long a scan waits for odometry, transforms and pictures that were logged after it,
    /// seconds. 1.
    pub patience_s: f64,
    /// Whether a missing transform of the scanner is an error; otherwise the scanner is assumed to
    /// be at the base. false.
    pub strict: bool,
}

impl Default for FrameConfig {
    fn default() -> Self {
        Self {
            topics: TopicConfig::default(),
            scan: ScanConfig::default(),
            odometry: OdometryLimits::default(),
            base_frame: None,
            odom_frame: "odom".to_owned(),
            picture_tolerance_s: 0.05,
            patience_s: 1.0,
            strict: false,
        }
    }
}

/// Why a bag cannot be read as frames.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// The bag cannot be opened.
    #[error(transparent)]
    Open(#[from] BagOpenError),
    /// The bag lacks a topic that is needed, or it is unclear which one to use.
    #[error(transparent)]
    Topics(#[from] TopicError),
    /// The same, and the bag is broken: what lacks may lie where it cannot be read.
    #[error("{error}; {}", sentences(broken))]
    Broken {
        /// What is missing, or unclear.
        error: TopicError,
        /// The files that cannot be read to the end.
        broken: Vec<Broken>,
    },
    /// No transform says where the scanner is (only if `strict`).
    #[error("no transform leads from {base} to the scanner's frame {sensor} (frames: {there})")]
    MissingTransform {
        /// The robot's frame.
        base: String,
        /// The scanner's frame.
        sensor: String,
        /// The frames in the bag.
        there: String,
    },
}

fn sentences(broken: &[Broken]) -> String {
    broken.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// A scan waiting for its odometry, transform and pictures.
struct Pending {
    stamp_ns: u64,
    log_ns: u64,
    message: msg::LaserScanMsg,
}

/// What can be done with a waiting scan.
enum Verdict {
    Wait,
    Drop(Dropped),
    Frame(Box<SensorFrame>),
}

/// The frames of a bag, in order of time: each scan with the odometry interpolated to its stamp
/// and, if all four cameras took a picture then, a panorama. What cannot be used is counted in
/// [`report`](Self::report). Memory does not grow with the bag.
pub struct Frames {
    config: FrameConfig,
    chosen: Chosen,
    info: BagInfo,
    messages: Messages,
    order: LogOrder<mcap::Message<'static>>,
    tree: TransformTree,
    track: OdometryTrack,
    cameras: Option<PanoramaCameras>,
    pending: VecDeque<Pending>,
    base_frame: Option<String>,
    last_stamp_ns: Option<u64>,
    log_ns: u64,
    is_at_end: bool,
    has_failed: bool,
    report: BagReport,
}

impl Frames {
    /// Opens the bag at `path` (an MCAP file, a rosbag2 folder or a folder of MCAP files).
    ///
    /// # Errors
    /// [`BagError`] when the bag cannot be opened, or it is unclear which topics to use.
    pub fn open(path: &Path, config: FrameConfig) -> Result<Self, BagError> {
        let info = survey(path)?;
        let mut chosen = choose(&info.topics, &config.topics).map_err(|error| match info.broken.as_slice() {
            [] => BagError::Topics(error),
            broken => BagError::Broken { error, broken: broken.to_vec() },
        })?;
        let report = BagReport { notes: std::mem::take(&mut chosen.notes), ..BagReport::default() };
        Ok(Self {
            messages: Messages::of_files(info.files.clone()),
            order: LogOrder::new(),
            tree: TransformTree::default(),
            track: OdometryTrack::new(config.odometry.clone()),
            cameras: chosen.cameras.is_some().then(|| PanoramaCameras::new(config.picture_tolerance_s, PICTURES)),
            pending: VecDeque::new(),
            base_frame: config.base_frame.clone(),
            last_stamp_ns: None,
            log_ns: 0,
            is_at_end: false,
            has_failed: false,
            report,
            chosen,
            info,
            config,
        })
    }

    /// What is in the bag.
    #[must_use]
    pub fn info(&self) -> &BagInfo {
        &self.info
    }

    /// What became of the messages read so far.
    #[must_use]
    pub fn report(&self) -> BagReport {
        BagReport { odometry_jumps: self.track.jumps(), broken: self.messages.broken().to_vec(), ..self.report.clone() }
    }

    /// Bytes read so far and bytes of the bag.
    #[must_use]
    pub fn progress(&self) -> (u64, u64) {
        self.messages.progress()
    }

    /// Whether frames can have panoramas: all four cameras have a topic.
    #[must_use]
    pub fn has_cameras(&self) -> bool {
        self.cameras.is_some()
    }

    fn read_message(&mut self, message: &mcap::Message<'_>) {
        let log_ns = message.log_time;
        self.log_ns = log_ns;
        self.report.messages += 1;
        let log_s = log_ns as f64 * 1e-9;
        self.report.start_s = Some(self.report.start_s.map_or(log_s, |start| start.min(log_s)));
        self.report.end_s = Some(self.report.end_s.map_or(log_s, |end| end.max(log_s)));
        let type_name = message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str());
        let topic = message.channel.topic.as_str();
        let config = &self.config.topics;
        if topic == self.chosen.scan && type_name == msg::LaserScanMsg::TYPE {
            self.read_scan(message);
        } else if (topic == config.tf || topic == config.tf_static) && type_name == msg::TfMessage::TYPE {
            self.read_transforms(message);
        } else if matches!(&self.chosen.odometry, OdometrySource::Messages(name) if name == topic)
            && type_name == msg::OdometryMsg::TYPE
        {
            self.read_odometry(message);
        } else if let (Some(names), Some(cameras)) = (&self.chosen.cameras, &mut self.cameras)
            && let Some(camera) = names.iter().position(|name| name == topic)
        {
            self.report.pictures += 1;
            match header_of(&message.data).and_then(|header| stamp_ns(header.stamp, log_ns)) {
                Some(stamp_ns) => {
                    let is_compressed = type_name == CompressedImage::TYPE;
                    cameras.push(camera, PictureMessage { stamp_ns, bytes: message.data.to_vec(), is_compressed });
                }
                None => self.report.drop_one(Dropped::PictureBroken),
            }
        }
    }

    fn read_scan(&mut self, message: &mcap::Message<'_>) {
        self.report.scans += 1;
        let decoded = cdr::decode::<msg::LaserScanMsg>(&message.data).ok();
        let Some((scan, stamp_ns)) = decoded.and_then(|scan| {
            let stamp_ns = stamp_ns(scan.header.stamp, message.log_time)?;
            Some((scan, stamp_ns))
        }) else {
            return self.report.drop_one(Dropped::ScanBroken);
        };
        // Frames have microsecond stamps.
        match self.last_stamp_ns.map(|last| (stamp_ns / 1000).cmp(&(last / 1000))) {
            Some(std::cmp::Ordering::Less) => self.report.drop_one(Dropped::ScanTimeBack),
            Some(std::cmp::Ordering::Equal) => self.report.drop_one(Dropped::ScanDuplicate),
            _ => {
                self.last_stamp_ns = Some(stamp_ns);
                self.pending.push_back(Pending { stamp_ns, log_ns: message.log_time, message: scan });
            }
        }
    }

    fn read_odometry(&mut self, message: &mcap::Message<'_>) {
        let Ok(odometry) = cdr::decode::<msg::OdometryMsg>(&message.data) else {
            self.report.odometry += 1;
            return self.report.drop_one(Dropped::OdometryBroken);
        };
        if self.config.base_frame.is_none() && self.base_frame.is_none() && !odometry.child_frame_id.is_empty() {
            self.base_frame = Some(frame_name(&odometry.child_frame_id).to_owned());
        }
        self.read_pose(odometry.header.stamp, message.log_time, &odometry.pose.pose);
    }

    fn read_pose(&mut self, stamp: Time, log_ns: u64, at: &msg::Pose) {
        self.report.odometry += 1;
        let odom_from_base = yaw_of(&at.orientation).map(|yaw| pose(at.position.x, at.position.y, yaw));
        let (Some(stamp_ns), Some(odom_from_base)) = (stamp_ns(stamp, log_ns), odom_from_base) else {
            return self.report.drop_one(Dropped::OdometryUnusable);
        };
        match self.track.push(stamp_ns, odom_from_base) {
            Ok(()) => {}
            Err(PoseRefused::NotNewer) => self.report.drop_one(Dropped::OdometryNotNewer),
            Err(PoseRefused::Unusable) => self.report.drop_one(Dropped::OdometryUnusable),
        }
    }

    fn read_transforms(&mut self, message: &mcap::Message<'_>) {
        let Ok(transforms) = cdr::decode::<msg::TfMessage>(&message.data) else {
            return self.report.drop_one(Dropped::TransformUnusable);
        };
        for stamped in &transforms.transforms {
            if !self.tree.insert(stamped) {
                self.report.drop_one(Dropped::TransformUnusable);
            } else if self.chosen.odometry == OdometrySource::Transforms
                && frame_name(&stamped.header.frame_id) == frame_name(&self.config.odom_frame)
                && self.base_frame.as_ref().is_none_or(|base| frame_name(base) == frame_name(&stamped.child_frame_id))
            {
                self.base_frame = Some(frame_name(&stamped.child_frame_id).to_owned());
                self.read_pose(stamped.header.stamp, message.log_time, &stamped.transform);
            }
        }
    }

    /// What to do with the oldest waiting scan.
    fn judge(&mut self, scan: &Pending) -> Result<Verdict, BagError> {
        let waited_s = self.log_ns.saturating_sub(scan.log_ns) as f64 * 1e-9;
        let may_wait = !self.is_at_end && waited_s <= self.config.patience_s && self.pending.len() < PENDING_LIMIT;
        let odom_from_base = match self.track.pose_at(scan.stamp_ns) {
            PoseLookup::Known(pose) => pose,
            PoseLookup::Later if may_wait => return Ok(Verdict::Wait),
            PoseLookup::Later | PoseLookup::Before => return Ok(Verdict::Drop(Dropped::ScanOutsideOdometry)),
            PoseLookup::Gap => return Ok(Verdict::Drop(Dropped::ScanOdometryGap)),
        };
        let is_settled = self.cameras.as_ref().is_none_or(|cameras| cameras.is_settled(scan.stamp_ns));
        if may_wait && !is_settled {
            return Ok(Verdict::Wait);
        }
        let base = self.base_frame.clone().unwrap_or_else(|| "base_link".to_owned());
        let sensor = frame_name(&scan.message.header.frame_id);
        let mount = match self.tree.base_from(&base, sensor) {
            Some(base_from_sensor) => Mount::of(&base_from_sensor),
            None if may_wait => return Ok(Verdict::Wait),
            None => self.missing_mount(&base, sensor)?,
        };
        if mount.tilt_rad > TILT_LIMIT_RAD {
            let tilt = mount.tilt_rad.to_degrees();
            self.note(format!("the scanner {sensor} is tilted by {tilt:.0}°: its scans are not level"));
        }
        Ok(self.frame(scan, odom_from_base, &mount).map_or_else(Verdict::Drop, |frame| Verdict::Frame(Box::new(frame))))
    }

    fn missing_mount(&mut self, base: &str, sensor: &str) -> Result<Mount, BagError> {
        if self.config.strict {
            let there = self.tree.frames().join(", ");
            return Err(BagError::MissingTransform { base: base.to_owned(), sensor: sensor.to_owned(), there });
        }
        self.note(format!("no transform leads from {base} to {sensor}: the scanner is taken to be at {base}"));
        Ok(Mount::identity())
    }

    fn note(&mut self, sentence: String) {
        if !self.report.notes.contains(&sentence) && self.report.notes.len() < 64 {
            tracing::warn!("{sentence}");
            self.report.notes.push(sentence);
        }
    }

    fn frame(&mut self, scan: &Pending, odom_from_base: Pose2, mount: &Mount) -> Result<SensorFrame, Dropped> {
        let panorama = self
            .cameras
            .as_mut()
            .and_then(|cameras| cameras.take_panorama(scan.stamp_ns))
            .and_then(|taken| taken.map_err(|refusal| self.report.drop_one(dropped(&refusal))).ok());
        let scan_in_base = scan_of(&scan.message, mount, &self.config.scan).ok_or(Dropped::ScanUnusable)?;
        Ok(SensorFrame { time_us: scan.stamp_ns / 1000, odom_from_base, scan: scan_in_base, panorama })
    }
}

fn dropped(refusal: &PanoramaRefused) -> Dropped {
    match refusal {
        PanoramaRefused::Picture { .. } => Dropped::PictureBroken,
        PanoramaRefused::Lens { .. } | PanoramaRefused::Shape(..) => Dropped::PictureShape,
    }
}

/// The header at the start of a message.
fn header_of(message: &[u8]) -> Option<msg::HeaderMsg> {
    cdr::decode(message).ok()
}

/// A stamp in nanoseconds; where it was left at zero, the time at which the message was logged.
fn stamp_ns(stamp: Time, log_ns: u64) -> Option<u64> {
    stamp.nanoseconds().map(|ns| if ns == 0 { log_ns } else { ns })
}

impl Iterator for Frames {
    type Item = Result<SensorFrame, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.has_failed {
            if let Some(scan) = self.pending.pop_front() {
                match self.judge(&scan) {
                    Ok(Verdict::Wait) => self.pending.push_front(scan),
                    Ok(Verdict::Drop(reason)) => {
                        self.report.drop_one(reason);
                        continue;
                    }
                    Ok(Verdict::Frame(frame)) => {
                        self.report.frames += 1;
                        self.report.panoramas += u64::from(frame.panorama.is_some());
                        return Some(Ok(*frame));
                    }
                    Err(error) => {
                        self.has_failed = true;
                        return Some(Err(error));
                    }
                }
            } else if self.is_at_end {
                return None;
            }
            match self.order.next(|| self.messages.next()) {
                Some(message) => self.read_message(&message),
                None => self.is_at_end = true,
            }
        }
        None
    }
}

/// A recorded run behind the port for robots. Frames come as fast as they are asked for; each is
/// read while the caller waits. A [`BagError`] is a failure of the driver.
impl Sensors for Frames {
    async fn sense(&mut self) -> Result<SensorFrame, RobotError> {
        match self.next() {
            Some(frame) => frame.map_err(RobotError::driver),
            None => Err(RobotError::Ended),
        }
    }
}
