//! Pictures that wait for their scan: four of one instant make a panorama.

use super::lens::{Lens, LensRefused};
use super::picture::{PictureRefused, picture_of};
use fht_perception::frame::Panorama;
use image::RgbImage;
use std::collections::VecDeque;

/// A picture as it came, in CDR.
#[derive(Clone, Debug)]
pub struct PictureMessage {
    /// Its stamp, nanoseconds.
    pub stamp_ns: u64,
    /// The message.
    pub bytes: Vec<u8>,
    /// Whether it is a `sensor_msgs/CompressedImage`, or else a `sensor_msgs/Image`.
    pub is_compressed: bool,
}

/// Why four pictures are no panorama.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PanoramaRefused {
    /// A picture of this camera cannot be read.
    #[error("{refusal}")]
    Picture {
        /// Which camera: 0 ahead, 1 left, 2 behind, 3 right.
        camera: usize,
        /// Why.
        refusal: PictureRefused,
    },
    /// This camera does not see its quarter.
    #[error("{refusal}")]
    Lens {
        /// Which camera.
        camera: usize,
        /// Why.
        refusal: LensRefused,
    },
    /// Without lenses, pictures must be square and of one size.
    #[error(
        "its pictures have {0} x {1} pixels: without camera_info all four must be square, of one size and of 90°; let \
         camera_info and a transform say how the cameras look"
    )]
    Shape(u32, u32),
}

impl PanoramaRefused {
    /// Which camera it is about; that ahead where it is about all.
    #[must_use]
    pub fn camera(&self) -> usize {
        match self {
            Self::Picture { camera, .. } | Self::Lens { camera, .. } => *camera,
            Self::Shape(..) => 0,
        }
    }
}

/// Pictures that wait for their scan, by camera.
#[derive(Debug)]
pub struct PanoramaCameras {
    queues: [VecDeque<PictureMessage>; 4],
    lenses: [Option<Lens>; 4],
    tolerance_ns: u64,
    /// Most pictures of each camera that wait.
    depth: usize,
}

impl PanoramaCameras {
    /// Of pictures whose stamps are off by at most `tolerance_s` seconds from the scan's; `depth`
    /// of each camera wait at a time.
    #[must_use]
    pub fn new(tolerance_s: f64, depth: usize) -> Self {
        let tolerance_ns = (tolerance_s.max(0.0) * 1e9) as u64;
        let (queues, lenses) = (std::array::from_fn(|_| VecDeque::new()), std::array::from_fn(|_| None));
        Self { queues, lenses, tolerance_ns, depth: depth.max(1) }
    }

    /// A picture of camera `camera` (0 ahead, 1 left, 2 behind, 3 right; others are passed over).
    pub fn push(&mut self, camera: usize, picture: PictureMessage) {
        let Some(queue) = self.queues.get_mut(camera) else { return };
        queue.push_back(picture);
        if queue.len() > self.depth {
            queue.pop_front();
        }
    }

    /// How a camera looks. Without it its pictures must be the view of 90° as they are.
    pub fn set_lens(&mut self, camera: usize, lens: Lens) {
        if let Some(known) = self.lenses.get_mut(camera) {
            *known = Some(lens);
        }
    }

    /// Whether every camera has a picture as new as `stamp_ns`, so that nothing closer to it will
    /// come.
    #[must_use]
    pub fn is_settled(&self, stamp_ns: u64) -> bool {
        self.queues.iter().all(|queue| queue.back().is_some_and(|newest| newest.stamp_ns >= stamp_ns))
    }

    /// Removes and decodes the panorama taken at `stamp_ns`, if all four cameras took a picture
    /// then. Older pictures are dropped.
    pub fn take_panorama(&mut self, stamp_ns: u64) -> Option<Result<Panorama, PanoramaRefused>> {
        let nearest = self.queues.each_ref().map(|queue| {
            let off = |waiting: &PictureMessage| waiting.stamp_ns.abs_diff(stamp_ns);
            let best = queue.iter().enumerate().min_by_key(|(_, waiting)| off(waiting))?;
            (off(best.1) <= self.tolerance_ns).then_some(best.0)
        });
        let [Some(front), Some(left), Some(back), Some(right)] = nearest else {
            let stale_ns = stamp_ns.saturating_sub(self.tolerance_ns);
            for queue in &mut self.queues {
                while queue.front().is_some_and(|oldest| oldest.stamp_ns < stale_ns) {
                    queue.pop_front();
                }
            }
            return None;
        };
        let mut camera = 0;
        let messages = [front, left, back, right].map(|index| {
            let picture = self.queues[camera].drain(..=index).next_back();
            camera += 1;
            picture
        });
        let [Some(front), Some(left), Some(back), Some(right)] = messages else { return None };
        Some(self.panorama(&[front, left, back, right]))
    }

    fn panorama(&self, messages: &[PictureMessage; 4]) -> Result<Panorama, PanoramaRefused> {
        let picture = |camera: usize| {
            let PictureMessage { bytes, is_compressed, .. } = &messages[camera];
            picture_of(bytes, *is_compressed).map_err(|refusal| PanoramaRefused::Picture { camera, refusal })
        };
        let pictures = [picture(0)?, picture(1)?, picture(2)?, picture(3)?];
        let sides = self.lenses.iter().enumerate().zip(&pictures).map(|((camera, lens), picture)| match lens {
            Some(lens) => lens.side(picture, camera),
            None => picture.width(),
        });
        let side = sides.min().unwrap_or_default();
        let view = |camera: usize| match &self.lenses[camera] {
            Some(lens) => {
                lens.view(&pictures[camera], camera, side).map_err(|refusal| PanoramaRefused::Lens { camera, refusal })
            }
            None => square(&pictures[camera], side),
        };
        Ok(Panorama { views: [view(0)?, view(1)?, view(2)?, view(3)?] })
    }
}

/// A picture that is a view as it is.
fn square(picture: &RgbImage, side: u32) -> Result<RgbImage, PanoramaRefused> {
    let (width, height) = picture.dimensions();
    let fits = width > 0 && (width, height) == (side, side);
    if fits { Ok(picture.clone()) } else { Err(PanoramaRefused::Shape(width, height)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cameras::{optical, yaw_of_camera};
    use fht_ros_messages::cdr;
    use fht_ros_messages::msg::{CameraInfoMsg, HeaderMsg, Image};

    const MS: u64 = 1_000_000;

    fn picture(stamp_ms: u64, width: u32, height: u32) -> PictureMessage {
        let data = vec![7; (width * height) as usize];
        let (header, encoding) = (HeaderMsg::default(), "mono8".to_owned());
        let image = Image { header, height, width, encoding, is_bigendian: 0, step: width, data: &data };
        PictureMessage { stamp_ns: stamp_ms * MS, bytes: cdr::encode(&image).expect("a message"), is_compressed: false }
    }

    #[test]
    fn a_panorama_needs_four_pictures_of_one_instant() {
        let mut cameras = PanoramaCameras::new(0.05, 16);
        for camera in 0..3 {
            cameras.push(camera, picture(1000, 1, 1));
        }
        assert!(!cameras.is_settled(990 * MS));
        assert!(cameras.take_panorama(1000 * MS).is_none());
        cameras.push(3, picture(1040, 1, 1));
        assert!(cameras.is_settled(1000 * MS) && !cameras.is_settled(1001 * MS));
        assert!(cameras.take_panorama(900 * MS).is_none());
        assert!(cameras.take_panorama(1000 * MS).is_some_and(|panorama| panorama.is_ok()));
        assert!(cameras.take_panorama(1000 * MS).is_none(), "each picture is used once");
        for camera in 0..4 {
            cameras.push(camera, if camera == 2 { picture(2000, 2, 2) } else { picture(2000, 1, 1) });
        }
        let refusal = cameras.take_panorama(2000 * MS).and_then(Result::err);
        assert_eq!(refusal, Some(PanoramaRefused::Shape(2, 2)));
    }

    #[test]
    fn few_pictures_wait_and_lenses_make_views_of_one_size() {
        let mut cameras = PanoramaCameras::new(0.05, 2);
        cameras.push(7, picture(1, 1, 1));
        for camera in 0..4 {
            let (width, height) = if camera == 0 { (80, 60) } else { (64, 64) };
            let info = CameraInfoMsg {
                width,
                height,
                k: [30.0, 0.0, f64::from(width) / 2.0, 0.0, 30.0, f64::from(height) / 2.0, 0.0, 0.0, 1.0],
                ..CameraInfoMsg::default()
            };
            cameras.set_lens(camera, Lens::of(&info, optical(yaw_of_camera(camera))).expect("a lens"));
            for stamp_ms in [1000, 2000, 3000] {
                cameras.push(camera, picture(stamp_ms, width, height));
            }
        }
        assert!(cameras.take_panorama(1000 * MS).is_none(), "the oldest are gone");
        let panorama = cameras.take_panorama(3000 * MS).and_then(Result::ok).expect("a panorama");
        assert!(panorama.views.iter().all(|view| view.dimensions() == (60, 60)));
    }
}
