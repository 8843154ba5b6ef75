//! The cameras of a simulated robot on its graph: four of 90° that look all round.

use crate::config::{PictureKind, SimRobotConfig};
use fht_perception::frame::Panorama;
use fht_ros::{Publisher, Qos, RosError, RosNode};
use fht_ros_frames::{CAMERAS, Compression, compress, header_message, optical_rotation};
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{CameraInfoMsg, HeaderMsg, Pose, TransformStamped, Vector3};
use image::RgbImage;
use serde::Serialize;
use std::f64::consts::FRAC_PI_2;

/// `sensor_msgs/Image`, with pixels of its own.
#[derive(Serialize)]
struct WholePicture {
    header: HeaderMsg,
    height: u32,
    width: u32,
    encoding: String,
    is_bigendian: u8,
    step: u32,
    data: Vec<u8>,
}

impl RosMessage for WholePicture {
    const TYPE: &'static str = "sensor_msgs/msg/Image";
}

/// `sensor_msgs/CompressedImage`, with a file of its own.
#[derive(Serialize)]
struct CompressedPicture {
    header: HeaderMsg,
    format: String,
    data: Vec<u8>,
}

impl RosMessage for CompressedPicture {
    const TYPE: &'static str = "sensor_msgs/msg/CompressedImage";
}

enum PicturePublisher {
    Whole(Publisher<WholePicture>),
    Compressed(Publisher<CompressedPicture>, Compression),
}

struct SimCamera {
    frame: String,
    pictures: PicturePublisher,
    info: Publisher<CameraInfoMsg>,
}

/// The topics of four cameras: `camera_front/image` (or `camera_front/image/compressed`),
/// `camera_front/camera_info` and so on.
pub(crate) struct SimCameras(Vec<SimCamera>);

fn optical_frame(camera: usize) -> String {
    format!("camera_{}_optical_frame", CAMERAS[camera])
}

impl SimCameras {
    pub(crate) async fn join(node: &RosNode, kind: PictureKind) -> Result<Self, RosError> {
        let qos = Qos { depth: 2, ..Qos::sensor_data() };
        let mut cameras = Vec::new();
        for (camera, name) in CAMERAS.iter().enumerate() {
            let topic = format!("camera_{name}/image");
            let below = format!("{topic}/compressed");
            let pictures = match kind {
                PictureKind::Raw => PicturePublisher::Whole(node.publisher(&topic, qos).await?),
                PictureKind::Png => PicturePublisher::Compressed(node.publisher(&below, qos).await?, Compression::Png),
                PictureKind::Jpeg => {
                    PicturePublisher::Compressed(node.publisher(&below, qos).await?, Compression::Jpeg)
                }
            };
            let info = node.publisher(&format!("camera_{name}/camera_info"), qos).await?;
            cameras.push(SimCamera { frame: optical_frame(camera), pictures, info });
        }
        Ok(Self(cameras))
    }

    /// Where they are on the robot.
    pub(crate) fn mounts(config: &SimRobotConfig) -> impl Iterator<Item = TransformStamped> + '_ {
        (0..CAMERAS.len()).map(|camera| TransformStamped {
            header: header_message(config.begin_us, &config.base_frame),
            child_frame_id: optical_frame(camera),
            transform: Pose {
                position: Vector3 { z: config.camera_height_m, ..Vector3::default() },
                orientation: optical_rotation(camera as f64 * FRAC_PI_2),
            },
        })
    }

    /// Says what they see. A picture that cannot be compressed is left out.
    pub(crate) fn publish(&self, time_us: u64, panorama: &Panorama) -> Result<(), RosError> {
        for (SimCamera { frame, pictures, info }, view) in self.0.iter().zip(&panorama.views) {
            let header = header_message(time_us, frame);
            info.publish(&how_it_looks(header.clone(), view))?;
            match pictures {
                PicturePublisher::Whole(publisher) => publisher.publish(&WholePicture {
                    header,
                    height: view.height(),
                    width: view.width(),
                    encoding: "rgb8".to_owned(),
                    is_bigendian: 0,
                    step: 3 * view.width(),
                    data: view.as_raw().clone(),
                })?,
                PicturePublisher::Compressed(publisher, compression) => match compress(view, *compression) {
                    Ok(data) => {
                        let format = compression.format().to_owned();
                        publisher.publish(&CompressedPicture { header, format, data })?;
                    }
                    Err(error) => tracing::warn!("{}: {error}", publisher.topic()),
                },
            }
        }
        Ok(())
    }
}

/// A pinhole of 90°.
fn how_it_looks(header: HeaderMsg, view: &RgbImage) -> CameraInfoMsg {
    let (width, height) = view.dimensions();
    let [across, down] = [width, height].map(|side| f64::from(side) / 2.0);
    CameraInfoMsg {
        header,
        height,
        width,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [across, 0.0, across, 0.0, down, down, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [across, 0.0, across, 0.0, 0.0, down, down, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfoMsg::default()
    }
}
