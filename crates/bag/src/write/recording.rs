//! A robot's sensor frames as the topics of a bag.

use super::metadata::Durability;
use super::writer::{BagWriter, WriteError};
use fht_perception::frame::{Panorama, SensorFrame};
use fht_perception::pose::Pose2;
use fht_ros_frames::{
    CAMERAS, Compression, OdometryMessages, compress, header_message, optical_rotation, pose_message, scan_message,
};
use fht_ros_messages::msg::{CompressedImage, LaserScanMsg, Pose, TfMessage, TransformStamped};
use std::f64::consts::FRAC_PI_2;

/// Writes frames: `/scan`, `/odom`, `/tf` (`odom → base_link`, and `map → odom` if it is
/// known), `/tf_static`, and the cameras' pictures as lossless PNG on
/// `/camera_{front,left,back,right}/image/compressed`. The odometry has the velocity between
/// frames, in `base_link`, and covariances that wheels deserve; z, roll and pitch are unknown.
///
/// What is read back is the same, bit for bit, if the scanner's angles divide a turn, its limits
/// are decimal, and the odometry's heading is an angle in double precision. So a recorded run of
/// the simulator replays to the same map.
#[derive(Clone, Debug, Default)]
pub struct FrameRecording {
    /// The scanner's mount as last written.
    mount: Option<Pose2>,
    has_cameras: bool,
    last_us: Option<u64>,
    odometry: OdometryMessages,
}

impl FrameRecording {
    /// Writes `frame` to `bag`; `map_from_base` is the robot's pose in the map, if it is known.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(
        &mut self,
        bag: &mut BagWriter,
        frame: &SensorFrame,
        map_from_base: Option<&Pose2>,
    ) -> Result<(), WriteError> {
        let time_us = frame.time_us;
        self.write_mounts(bag, frame)?;
        let link = |parent: &str, child: &str, pose: &Pose2| TransformStamped {
            header: header_message(time_us, parent),
            child_frame_id: child.to_owned(),
            transform: pose_message(pose),
        };
        let odometry = self.odometry.next(time_us, &frame.odom_from_base);
        bag.write("/odom", Durability::Volatile, time_us, &odometry)?;
        let mut transforms = vec![link("odom", "base_link", &frame.odom_from_base)];
        if let Some(map_from_base) = map_from_base {
            transforms.push(link("map", "odom", &(map_from_base * frame.odom_from_base.inverse())));
        }
        bag.write("/tf", Durability::Volatile, time_us, &TfMessage { transforms })?;
        if let Some(panorama) = &frame.panorama {
            write_panorama(bag, time_us, panorama)?;
        }
        let period_s = self.last_us.map_or(0.0, |last| time_us.saturating_sub(last) as f64 * 1e-6);
        self.last_us = Some(time_us);
        let scan: LaserScanMsg = scan_message(&frame.scan, header_message(time_us, "laser"), period_s);
        bag.write("/scan", Durability::Volatile, time_us, &scan)
    }

    fn write_mounts(&mut self, bag: &mut BagWriter, frame: &SensorFrame) -> Result<(), WriteError> {
        let has_cameras = self.has_cameras || frame.panorama.is_some();
        if self.mount == Some(frame.scan.base_from_sensor) && has_cameras == self.has_cameras {
            return Ok(());
        }
        self.mount = Some(frame.scan.base_from_sensor);
        self.has_cameras = has_cameras;
        let mut transforms = vec![TransformStamped {
            header: header_message(frame.time_us, "base_link"),
            child_frame_id: "laser".to_owned(),
            transform: pose_message(&frame.scan.base_from_sensor),
        }];
        if has_cameras {
            transforms.extend((0..CAMERAS.len()).map(|camera| TransformStamped {
                header: header_message(frame.time_us, "base_link"),
                child_frame_id: optical_frame(camera),
                transform: Pose { orientation: optical_rotation(camera as f64 * FRAC_PI_2), ..Pose::default() },
            }));
        }
        bag.write("/tf_static", Durability::TransientLocal, frame.time_us, &TfMessage { transforms })
    }
}

fn optical_frame(camera: usize) -> String {
    format!("camera_{}_optical_frame", CAMERAS[camera])
}

fn write_panorama(bag: &mut BagWriter, time_us: u64, panorama: &Panorama) -> Result<(), WriteError> {
    for (camera, view) in panorama.views.iter().enumerate() {
        let data = compress(view, Compression::Png)
            .map_err(|error| WriteError::Message { type_name: "sensor_msgs/msg/CompressedImage", reason: error })?;
        let header = header_message(time_us, &optical_frame(camera));
        let message = CompressedImage { header, format: Compression::Png.format().to_owned(), data: &data };
        let topic = format!("/camera_{}/image/compressed", CAMERAS[camera]);
        bag.write(&topic, Durability::Volatile, time_us, &message)?;
    }
    Ok(())
}
