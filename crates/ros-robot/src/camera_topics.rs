//! Which topics a robot's four cameras have. No I/O.

use crate::config::RosRobotConfig;
use fht_ros::{Endpoint, EndpointKind, NameError};
use fht_ros_frames::CAMERAS;
use fht_ros_messages::RosMessage;
use fht_ros_messages::msg::{CompressedImage, Image};

/// What `image_transport` appends to a topic.
const COMPRESSED: &str = "/compressed";

/// The topics of a camera, by their full names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CameraTopic {
    pub(crate) pictures: String,
    pub(crate) is_compressed: bool,
    /// How it looks (`sensor_msgs/CameraInfo`).
    pub(crate) info: String,
}

impl CameraTopic {
    fn new(pictures: String, is_compressed: bool) -> Self {
        let bare = pictures.strip_suffix(COMPRESSED).unwrap_or(&pictures);
        let within = bare.rsplit_once('/').map_or("", |(within, _)| within);
        Self { info: format!("{within}/camera_info"), pictures, is_compressed }
    }

    /// The camera that somebody publishes as `name`, or compressed below it.
    pub(crate) fn published(name: &str, endpoints: &[Endpoint]) -> Option<Self> {
        let is_there = |topic: &str, ros_type: &str| {
            endpoints
                .iter()
                .any(|end| end.kind == EndpointKind::Publisher && end.name == topic && end.ros_type == ros_type)
        };
        let below = format!("{name}{COMPRESSED}");
        // Less is sent of those that are compressed.
        let kinds = [(below.as_str(), true), (name, true), (name, false)];
        let found = kinds.into_iter().find(|(topic, is_compressed)| {
            is_there(topic, if *is_compressed { CompressedImage::TYPE } else { Image::TYPE })
        });
        found.map(|(topic, is_compressed)| Self::new(topic.to_owned(), is_compressed))
    }
}

/// The topics that are looked for, by their full names, and whether somebody has named them.
pub(crate) fn names(
    config: &RosRobotConfig,
    full: impl Fn(&str) -> Result<String, NameError>,
) -> Result<([String; 4], bool), NameError> {
    let usual = || CAMERAS.map(|name| format!("camera_{name}/image"));
    let [front, left, back, right] = config.cameras.clone().unwrap_or_else(usual);
    Ok(([full(&front)?, full(&left)?, full(&back)?, full(&right)?], config.cameras.is_some()))
}

/// The topics of the cameras that are used: those that are named, or the usual ones if all four are
/// there.
pub(crate) fn chosen(
    config: &RosRobotConfig,
    endpoints: &[Endpoint],
    full: impl Fn(&str) -> Result<String, NameError>,
) -> Result<Option<[CameraTopic; 4]>, NameError> {
    if config.without_cameras {
        return Ok(None);
    }
    let (names, are_named) = names(config, full)?;
    let found = names.map(|name| {
        CameraTopic::published(&name, endpoints).or_else(|| {
            // It may come later, and a bridge tells nobody of it.
            let is_compressed = name.ends_with(COMPRESSED);
            are_named.then(|| CameraTopic::new(name, is_compressed))
        })
    });
    let [Some(front), Some(left), Some(back), Some(right)] = found else { return Ok(None) };
    Ok(Some([front, left, back, right]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros::{Qos, resolve};

    fn publisher(name: &str, ros_type: &str) -> Endpoint {
        Endpoint {
            kind: EndpointKind::Publisher,
            name: name.to_owned(),
            ros_type: ros_type.to_owned(),
            hash: String::new(),
            qos: Qos::sensor_data(),
            node: "/camera".to_owned(),
        }
    }

    fn found(config: &RosRobotConfig, endpoints: &[Endpoint]) -> Option<[CameraTopic; 4]> {
        chosen(config, endpoints, |name| resolve(name, "r1", "mapper")).expect("names")
    }

    #[test]
    fn four_cameras_are_found_by_their_usual_names() {
        let names = CAMERAS.map(|name| format!("/r1/camera_{name}/image"));
        let mut endpoints: Vec<Endpoint> = names.iter().map(|name| publisher(name, Image::TYPE)).collect();
        endpoints.push(publisher(&format!("{}/compressed", names[1]), CompressedImage::TYPE));
        let cameras = found(&RosRobotConfig::default(), &endpoints).expect("they are there");
        assert_eq!(cameras[0], CameraTopic::new(names[0].clone(), false));
        assert_eq!(cameras[0].info, "/r1/camera_front/camera_info");
        assert_eq!(
            (cameras[1].pictures.as_str(), cameras[1].is_compressed),
            ("/r1/camera_left/image/compressed", true)
        );
        assert_eq!(cameras[1].info, "/r1/camera_left/camera_info");
        assert_eq!(found(&RosRobotConfig::default(), &endpoints[1..]), None);
        let blind = RosRobotConfig { without_cameras: true, ..RosRobotConfig::default() };
        assert_eq!(found(&blind, &endpoints), None);
    }

    #[test]
    fn cameras_that_are_named_may_come_later() {
        let named = ["/a/image_raw", "b/image_raw", "c", "d/image/compressed"].map(str::to_owned);
        let config = RosRobotConfig { cameras: Some(named), ..RosRobotConfig::default() };
        let cameras = found(&config, &[]).expect("they are named");
        let names = cameras.each_ref().map(|camera| (camera.pictures.as_str(), camera.info.as_str()));
        assert_eq!(names[0], ("/a/image_raw", "/a/camera_info"));
        assert_eq!(names[2], ("/r1/c", "/r1/camera_info"));
        assert_eq!(cameras.map(|camera| camera.is_compressed), [false, false, false, true]);
    }
}
