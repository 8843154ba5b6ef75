//! Sensor logs as roboticists keep them: rosbag2 bags in MCAP files, read and written.
//!
//! ```text
//!  MCAP files ── read ──→ SensorFrame ──→ a mapper, as if the robot drove again
//!      ↑          │
//!      │       fht_ros_messages, fht_ros_frames: messages, CDR, headings, scans, frames
//!      │          │
//!      └──────── write ←── SensorFrame ←── a robot that records its run
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `read` | from files to [`Frames`]: which topics hold what, odometry at each scan |
//! | `write` | frames ([`FrameRecording`]) and maps to a bag ([`BagWriter`], [`Recorder`]) |
//!
//! A run that is recorded and read back gives the same frames, bit for bit, so it replays to the
//! same map:
//!
//! ```
//! use fht_bag::{BagWriter, FrameConfig, FrameRecording, Frames};
//! use fht_perception::frame::{LaserScan, SensorFrame};
//! use fht_perception::pose::{Pose2, pose};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("run.mcap");
//! let scan = LaserScan {
//!     base_from_sensor: Pose2::identity(),
//!     angle_min: 0.0,
//!     angle_increment: std::f64::consts::TAU / 360.0,
//!     range_min_m: 0.1,
//!     range_max_m: 10.0,
//!     ranges_m: vec![2.5; 360],
//! };
//! let odom_from_base = pose(1.0, 0.0, 0.3);
//! let frame = SensorFrame { time_us: 1_000_000, odom_from_base, scan, panorama: None };
//!
//! let mut bag = BagWriter::create(&path)?;
//! FrameRecording::default().write(&mut bag, &frame, None)?;
//! bag.finish()?;
//!
//! let mut frames = Frames::open(&path, FrameConfig::default())?;
//! let read_back = frames.next().expect("one frame")?;
//! assert_eq!(read_back.odom_from_base, frame.odom_from_base);
//! assert_eq!(read_back.scan.ranges_m, frame.scan.ranges_m);
//! println!("{}", frames.report());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod read;
mod write;

pub use fht_ros_frames::{OdometryLimits, ScanConfig};
pub use read::files::{BagOpenError, files_of};
pub use read::frames::{BagError, FrameConfig, Frames};
pub use read::report::{BagReport, Dropped};
pub use read::stream::{Broken, Messages};
pub use read::survey::{BagInfo, BagTopic, examine, survey};
pub use read::topics::{TopicConfig, TopicError};
pub use write::map::write_map;
pub use write::metadata::Durability;
pub use write::recorder::Recorder;
pub use write::recording::FrameRecording;
pub use write::writer::{BagWriter, WriteError, WriteReport};
