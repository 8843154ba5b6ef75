//! The subscriptions to a robot's cameras.

use crate::camera_topics::CameraTopic;
use fht_ros::{Qos, Received, RosError, RosNode, Subscription};
use fht_ros_messages::msg::{CameraInfoMsg, CompressedImage, Image};

/// Pictures are large: few wait.
const DEPTH: usize = 2;

enum PictureSubscription {
    Whole(Subscription<Image<'static>>),
    Compressed(Subscription<CompressedImage<'static>>),
}

/// What comes of four cameras.
pub(crate) struct PictureTopics {
    pictures: Vec<PictureSubscription>,
    infos: Vec<Subscription<CameraInfoMsg>>,
}

impl PictureTopics {
    /// Subscribes to the pictures of four cameras, and to how these look.
    ///
    /// # Errors
    /// [`RosError`].
    pub(crate) async fn subscribe(node: &RosNode, topics: &[CameraTopic; 4]) -> Result<Self, RosError> {
        let (mut pictures, mut infos) = (Vec::new(), Vec::new());
        let qos = Qos { depth: DEPTH, ..Qos::sensor_data() };
        for CameraTopic { pictures: topic, is_compressed, info } in topics {
            pictures.push(match is_compressed {
                true => PictureSubscription::Compressed(node.subscribe(topic, qos).await?),
                false => PictureSubscription::Whole(node.subscribe(topic, qos).await?),
            });
            infos.push(node.subscribe(info, Qos { depth: 1, ..qos }).await?);
        }
        Ok(Self { pictures, infos })
    }

    /// Takes the pictures that have come, by camera.
    pub(crate) fn take_pictures(&self) -> impl Iterator<Item = (usize, Received)> + '_ {
        self.pictures.iter().enumerate().flat_map(|(camera, pictures)| {
            std::iter::from_fn(move || match pictures {
                PictureSubscription::Whole(pictures) => pictures.take_raw(),
                PictureSubscription::Compressed(pictures) => pictures.take_raw(),
            })
            .map(move |received| (camera, received))
        })
    }

    /// Takes what has come of how the cameras look; what is none is passed over.
    pub(crate) fn take_infos(&self) -> impl Iterator<Item = (usize, CameraInfoMsg)> + '_ {
        self.infos.iter().enumerate().flat_map(|(camera, infos)| {
            std::iter::from_fn(move || infos.take_raw())
                .filter_map(|received| received.decode().ok())
                .map(move |info| (camera, info))
        })
    }
}
