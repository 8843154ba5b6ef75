//! Sensor logs as roboticists keep them: rosbag2 bags in MCAP files, read and written.
//!
//! | module | idea |
//! | --- | --- |
//! | [`msg`] | the ROS 2 messages, field for field |
//! | [`cdr`] | their serialization |
//! | [`files`] | which files make up a bag |
//! | [`stream`] | their messages, as far as they can be read |
//! | [`survey`](mod@survey) | what is in a bag |
//! | [`topics`] | which topics hold what |
//! | [`tf`] | where the scanner is on the robot |
//! | [`yaw`] | headings as quaternions |
//! | [`scan`], [`odometry`], `picture` | one kind of message each |
//! | [`frames`] | all of it: [`SensorFrame`](crate::frame::SensorFrame)s |
//! | [`report`] | what became of the messages |
//! | `definitions`, `metadata` | what readers of a bag want to know |
//! | [`writer`] | writing a bag |
//! | [`recording`] | frames as messages |
//! | [`recorder`] | a bag that is written in a thread of its own |
//!
//! ```no_run
//! use fht_robot::bag::{FrameConfig, Frames};
//!
//! let mut frames = Frames::open("run".as_ref(), FrameConfig::default())?;
//! for frame in &mut frames {
//!     let frame = frame?;
//!     println!("{} µs: {} beams", frame.time_us, frame.scan.ranges_m.len());
//! }
//! println!("{}", frames.report());
//! # Ok::<(), fht_robot::bag::FrameError>(())
//! ```

pub mod cdr;
mod definitions;
pub mod files;
pub mod frames;
mod metadata;
pub mod msg;
pub mod odometry;
mod picture;
pub mod recorder;
pub mod recording;
pub mod report;
pub mod scan;
pub mod stream;
pub mod survey;
pub mod tf;
pub mod topics;
pub mod writer;
pub mod yaw;

pub use files::OpenError;
pub use frames::{FrameConfig, FrameError, Frames};
pub use metadata::Durability;
pub use recorder::Recorder;
pub use recording::FrameRecording;
pub use report::{BagReport, Dropped};
pub use stream::{Broken, Messages};
pub use survey::{BagInfo, Topic, survey};
pub use topics::{TopicConfig, TopicError};
pub use writer::{BagWriter, WriteError, WriteReport};
