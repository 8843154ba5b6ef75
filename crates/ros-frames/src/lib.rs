//! What ROS 2 messages mean to a robot on a plane, and back. No I/O, no clock.
//!
//! | module | idea |
//! | --- | --- |
//! | `yaw` | headings as quaternions and back, bit for bit |
//! | `plane` | poses on the plane, and times, as messages |
//! | `floor` | what is known of a floor as a grid ([`FloorGrid`]) |
//! | `scan` | laser scans as the robot's own and back |
//! | `points` | clouds of points as scans of what stands in the way |
//! | `cameras` | the pictures of four cameras as panoramas |
//! | `tf` | the tree of coordinate frames, and how a scanner is mounted |
//! | `odometry` | poses as odometry, with velocities and covariances |
//! | `odometry_uncertainty` | how uncertain a pose by the wheels is |
//! | `track` | poses by time, interpolated; resets of the odometry |
//!
//! ```
//! use fht_perception::pose::pose;
//! use fht_ros_frames::{Mount, TransformTree, pose_message};
//! use fht_ros_messages::msg::TransformStamped;
//!
//! let mut stamped = TransformStamped::default();
//! stamped.child_frame_id = "laser".to_owned();
//! stamped.header.frame_id = "base_link".to_owned();
//! stamped.transform = pose_message(&pose(0.2, 0.0, 0.0));
//! let mut tree = TransformTree::default();
//! assert!(tree.insert(&stamped));
//! let base_from_laser = tree.base_from("base_link", "laser").expect("they are connected");
//! assert_eq!(Mount::of(&base_from_laser).base_from_sensor, pose(0.2, 0.0, 0.0));
//! ```

mod cameras;
mod floor;
mod odometry;
mod odometry_uncertainty;
mod plane;
mod points;
mod scan;
mod tf;
mod track;
mod yaw;

pub use cameras::{
    CAMERAS, Compression, Lens, LensRefused, PanoramaCameras, PanoramaRefused, PictureMessage, PictureRefused,
    compress, optical_rotation, picture_of,
};
pub use floor::{FloorGrid, grid_message, update_message};
pub use odometry::OdometryMessages;
pub use plane::{header_message, pose_message};
pub use points::{BandConfig, CloudRefused, scan_of_points};
pub use scan::{ScanConfig, scan_message, scan_of};
pub use tf::{Mount, TransformTree, frame_name};
pub use track::{OdometryLimits, OdometryTrack, PoseLookup, PoseRefused};
pub use yaw::{heading_of, quaternion_of, yaw_of};
