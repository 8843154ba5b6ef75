//! From pictures to panoramas: those of four cameras that were taken at about the time of a scan,
//! seen through their lenses. No I/O and no clock: times of arrival are given.
//!
//! Frames wait for scans and odometry, and for no pictures: without them places are mapped and
//! found all the same. So what is wrong with a camera is said, and the robot goes on.

use crate::camera_topics::CameraTopic;
use fht_perception::frame::Panorama;
use fht_ros_frames::{Lens, PanoramaCameras, PictureMessage, TransformTree, frame_name};
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{CameraInfoMsg, HeaderMsg};

/// Most pictures of each camera that wait: they are large.
const WAITING: usize = 4;
/// Pictures come and are decoded, less often than scans: at most one panorama in this time,
/// nanoseconds.
const EVERY_NS: u64 = 500_000_000;
/// Pictures and scans that are farther apart belong not together, seconds: in this time a robot
/// moves by some centimetres.
const TOLERANCE_S: f64 = 0.15;
/// A camera that says nothing for so long is silent, seconds.
const SILENT_S: f64 = 3.0;
/// Most doubts that wait to be told.
const DOUBTS: usize = 8;

/// What is known of one camera.
struct Camera {
    topic: CameraTopic,
    /// When a picture came last, seconds, and its stamp.
    heard: Option<(f64, u64)>,
    info: Option<CameraInfoMsg>,
    has_lens: bool,
}

/// The pictures of a robot's four cameras.
pub(crate) struct Pictures {
    cameras: [Camera; 4],
    waiting: PanoramaCameras,
    /// The scan that had the last panorama, nanoseconds, and when that was, seconds.
    last_ns: Option<u64>,
    last_s: f64,
    doubts: Vec<String>,
}

impl Pictures {
    pub(crate) fn new(topics: [CameraTopic; 4]) -> Self {
        let cameras = topics.map(|topic| Camera { topic, heard: None, info: None, has_lens: false });
        let waiting = PanoramaCameras::new(TOLERANCE_S, WAITING);
        Self { cameras, waiting, last_ns: None, last_s: 0.0, doubts: Vec::new() }
    }

    /// What is wrong and was not told yet: sentences.
    pub(crate) fn take_doubts(&mut self) -> Vec<String> {
        std::mem::take(&mut self.doubts)
    }

    fn doubt(&mut self, sentence: String) {
        if self.doubts.len() < DOUBTS {
            self.doubts.push(sentence);
        }
    }

    /// A picture of camera `camera`, in CDR. `now_ns` is the time, if it is known: that of pictures
    /// without a stamp.
    pub(crate) fn take_picture(&mut self, camera: usize, bytes: Vec<u8>, arrived_s: f64, now_ns: Option<u64>) {
        let Some(Camera { topic, heard, .. }) = self.cameras.get_mut(camera) else { return };
        let stamp = cdr::decode::<HeaderMsg>(&bytes).ok().and_then(|header| header.stamp.nanoseconds());
        let stamp_ns = if stamp == Some(0) { now_ns } else { stamp };
        let Some(stamp_ns) = stamp_ns else {
            let sentence = format!("{} has stamps that are no times", topic.pictures);
            return self.doubt(sentence);
        };
        *heard = Some((arrived_s, stamp_ns));
        let is_compressed = topic.is_compressed;
        self.waiting.push(camera, PictureMessage { stamp_ns, bytes, is_compressed });
    }

    /// How camera `camera` looks.
    pub(crate) fn take_info(&mut self, camera: usize, info: CameraInfoMsg) {
        if let Some(Camera { info: known, has_lens, .. }) = self.cameras.get_mut(camera)
            && known.as_ref().is_none_or(|known| (&known.k, known.width) != (&info.k, info.width))
        {
            (*known, *has_lens) = (Some(info), false);
        }
    }

    /// The panorama that belongs to a scan, if one is due and all four pictures are there.
    pub(crate) fn panorama(
        &mut self,
        scan_ns: u64,
        now_s: f64,
        tree: &TransformTree,
        base: &str,
        scan_topic: &str,
    ) -> Option<Panorama> {
        let is_due = self.last_ns.is_none_or(|last_ns| scan_ns >= last_ns.saturating_add(EVERY_NS));
        if !is_due || !self.all_have_lenses(tree, base) {
            return None;
        }
        let panorama = match self.waiting.take_panorama(scan_ns) {
            None => {
                if now_s - self.last_s >= SILENT_S {
                    let sentence = self.missing(scan_ns, now_s, scan_topic);
                    self.doubts_of(sentence);
                }
                return None;
            }
            Some(Ok(panorama)) => Some(panorama),
            Some(Err(refusal)) => {
                let topic = &self.cameras[refusal.camera()].topic.pictures;
                let sentence = format!("{topic} is of no use for panoramas: {refusal}");
                self.doubt(sentence);
                None
            }
        };
        (self.last_ns, self.last_s) = (Some(scan_ns), now_s);
        panorama
    }

    fn doubts_of(&mut self, sentence: Option<String>) {
        if let Some(sentence) = sentence {
            self.doubt(sentence);
        }
    }

    /// Makes lenses of what the cameras say of themselves. A camera that says nothing gives views
    /// as they are; one whose transform is missing gives none.
    fn all_have_lenses(&mut self, tree: &TransformTree, base: &str) -> bool {
        let mut are_there = true;
        for index in 0..self.cameras.len() {
            let Camera { topic, info, has_lens, .. } = &mut self.cameras[index];
            let Some(info) = info.as_ref().filter(|_| !*has_lens) else { continue };
            let frame = frame_name(&info.header.frame_id);
            let lens = match tree.base_from(base, frame) {
                Some(base_from_camera) => {
                    Lens::of(info, base_from_camera.rotation).map_err(|refusal| refusal.to_string())
                }
                None => Err(format!(
                    "no transform leads from {base} to {frame}, its frame: publish it on tf_static \
                     (robot_state_publisher, or static_transform_publisher)"
                )),
            };
            match lens {
                Ok(lens) => {
                    *has_lens = true;
                    let bent = lens.is_distorted().then(|| {
                        format!(
                            "the pictures of {} are bent by its lens, and used as they are: better give rectified ones \
                             (image_proc: image_rect)",
                            topic.pictures
                        )
                    });
                    self.waiting.set_lens(index, lens);
                    self.doubts_of(bent);
                }
                Err(why) => {
                    let sentence = format!("{} is of no use for panoramas: {why}", topic.pictures);
                    self.doubt(sentence);
                    are_there = false;
                }
            }
        }
        are_there
    }

    /// Why there are no four pictures of one instant.
    fn missing(&self, scan_ns: u64, now_s: f64, scan_topic: &str) -> Option<String> {
        const MEANWHILE: &str = "meanwhile places are known by their walls alone";
        for Camera { topic, heard, .. } in &self.cameras {
            let CameraTopic { pictures, is_compressed, .. } = topic;
            let kind = if *is_compressed { "sensor_msgs/CompressedImage" } else { "sensor_msgs/Image" };
            match heard {
                None => {
                    return Some(format!("nothing has come on {pictures} ({kind}): does its driver run? {MEANWHILE}"));
                }
                Some((arrived_s, _)) if now_s - arrived_s >= SILENT_S => {
                    let for_s = now_s - arrived_s;
                    return Some(format!(
                        "{pictures} has been silent for {for_s:.1} s: does its driver run? (ros2 topic hz {pictures}) \
                         {MEANWHILE}"
                    ));
                }
                Some(_) => {}
            }
        }
        let apart_s = |stamp_ns: u64| (stamp_ns as f64 - scan_ns as f64) * 1e-9;
        let stamps = self.cameras.iter().filter_map(|Camera { topic, heard, .. }| {
            heard.map(|(_, stamp_ns)| (topic.pictures.as_str(), apart_s(stamp_ns)))
        });
        let (pictures, apart_s) = stamps.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        let side = if apart_s > 0.0 { "ahead of" } else { "behind" };
        Some(format!(
            "the pictures of {pictures} are {:.1} s {side} the scans of {scan_topic}: set their clocks by the same source \
             (chrony), or use_sim_time for both, and see how busy the camera's driver is; {MEANWHILE}",
            apart_s.abs()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_frames::{CAMERAS, header_message, optical_rotation};
    use fht_ros_messages::msg::{Image, Pose, TransformStamped};
    use std::f64::consts::FRAC_PI_2;

    fn pictures() -> Pictures {
        Pictures::new(CAMERAS.map(|name| CameraTopic {
            pictures: format!("/r1/camera_{name}/image"),
            is_compressed: false,
            info: format!("/r1/camera_{name}/camera_info"),
        }))
    }

    fn picture(stamp_us: u64) -> Vec<u8> {
        let (header, encoding, data) = (header_message(stamp_us, "camera"), "mono8".to_owned(), &[7; 64][..]);
        cdr::encode(&Image { header, height: 8, width: 8, encoding, is_bigendian: 0, step: 8, data })
            .expect("a message")
    }

    fn all_four(pictures: &mut Pictures, stamp_us: u64, arrived_s: f64) {
        (0..4).for_each(|camera| pictures.take_picture(camera, picture(stamp_us), arrived_s, None));
    }

    fn at(pictures: &mut Pictures, scan_us: u64, now_s: f64, tree: &TransformTree) -> Option<Panorama> {
        pictures.panorama(scan_us * 1000, now_s, tree, "base_link", "/r1/scan")
    }

    #[test]
    fn a_panorama_comes_twice_a_second_at_most() {
        let (mut pictures, tree) = (pictures(), TransformTree::default());
        let mut came = Vec::new();
        for step in 0..20_u64 {
            let (stamp_us, now_s) = (1_000_000 + step * 100_000, step as f64 * 0.1);
            all_four(&mut pictures, stamp_us, now_s);
            // Scans are a little later.
            came.extend(at(&mut pictures, stamp_us + 40_000, now_s, &tree).map(|_| step));
        }
        assert_eq!(came, [0, 5, 10, 15]);
        assert!(pictures.take_doubts().is_empty());
    }

    #[test]
    fn cameras_that_tell_how_they_look_need_their_transforms() {
        let (mut pictures, mut tree) = (pictures(), TransformTree::default());
        all_four(&mut pictures, 1_000_000, 0.0);
        for camera in 0..4 {
            let header = header_message(1, &format!("camera_{camera}"));
            let k = [4.0, 0.0, 4.0, 0.0, 4.0, 4.0, 0.0, 0.0, 1.0];
            pictures.take_info(camera, CameraInfoMsg { header, width: 8, height: 8, k, ..CameraInfoMsg::default() });
        }
        assert!(at(&mut pictures, 1_000_000, 0.0, &tree).is_none());
        let doubts = pictures.take_doubts();
        assert!(doubts.len() == 4 && doubts[1].contains("no transform leads from base_link to camera_1"), "{doubts:?}");
        for camera in 0..4 {
            let orientation = optical_rotation(camera as f64 * FRAC_PI_2);
            assert!(tree.insert(&TransformStamped {
                header: header_message(1, "base_link"),
                child_frame_id: format!("camera_{camera}"),
                transform: Pose { orientation, ..Pose::default() },
            }));
        }
        assert!(at(&mut pictures, 1_000_000, 0.0, &tree).is_some());
        assert!(pictures.take_doubts().is_empty());
    }
}
