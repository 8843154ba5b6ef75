//! Pictures of a bag: four cameras make a panorama.

use super::report::Dropped;
use fht_perception::frame::Panorama;
use fht_ros_messages::cdr;
use fht_ros_messages::msg::{CompressedImage, Image};
use image::{ImageReader, Limits, RgbImage};
use std::collections::VecDeque;
use std::io::Cursor;

/// Most pictures of each camera that wait for their scan.
const QUEUE: usize = 16;
/// Longest side of a picture, pixels.
const SIDE_LIMIT: u32 = 8192;
/// Most memory that decoding a picture may take, bytes.
const DECODE_LIMIT: u64 = 512 << 20;

/// A picture as logged: its stamp and its message.
struct Waiting {
    stamp_ns: u64,
    message: Vec<u8>,
    is_compressed: bool,
}

/// Pictures waiting for their scan, by camera.
pub(crate) struct Cameras {
    queues: [VecDeque<Waiting>; 4],
    tolerance_ns: u64,
}

impl Cameras {
    pub(crate) fn new(tolerance_s: f64) -> Self {
        let tolerance_ns = (tolerance_s.max(0.0) * 1e9) as u64;
        Self { queues: std::array::from_fn(|_| VecDeque::new()), tolerance_ns }
    }

    pub(crate) fn push(&mut self, camera: usize, stamp_ns: u64, message: Vec<u8>, is_compressed: bool) {
        let queue = &mut self.queues[camera];
        queue.push_back(Waiting { stamp_ns, message, is_compressed });
        if queue.len() > QUEUE {
            queue.pop_front();
        }
    }

    /// Whether every camera has a picture as new as `stamp_ns`, so that nothing closer to it will
    /// come.
    pub(crate) fn is_settled(&self, stamp_ns: u64) -> bool {
        self.queues.iter().all(|queue| queue.back().is_some_and(|newest| newest.stamp_ns >= stamp_ns))
    }

    /// Removes and decodes the panorama taken at `stamp_ns`, if all four cameras took a picture
    /// then. Older pictures are dropped.
    pub(crate) fn take_panorama(&mut self, stamp_ns: u64) -> Option<Result<Panorama, Dropped>> {
        let nearest = self.queues.each_ref().map(|queue| {
            let off = |waiting: &Waiting| waiting.stamp_ns.abs_diff(stamp_ns);
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
        let views = [front, left, back, right].map(|index| {
            let picture = self.queues[camera].drain(..=index).next_back();
            camera += 1;
            picture.and_then(|waiting| decode(&waiting.message, waiting.is_compressed))
        });
        let [Some(front), Some(left), Some(back), Some(right)] = views else {
            return Some(Err(Dropped::PictureBroken));
        };
        let views = [front, left, back, right];
        let (width, height) = views[0].dimensions();
        let fits = width == height && width > 0 && views.iter().all(|view| view.dimensions() == (width, height));
        Some(if fits { Ok(Panorama { views }) } else { Err(Dropped::PictureShape) })
    }
}

/// The picture in a message; `None` if it cannot be decoded.
fn decode(message: &[u8], is_compressed: bool) -> Option<RgbImage> {
    if is_compressed {
        let message: CompressedImage<'_> = cdr::decode(message).ok()?;
        // `format` has many spellings; the picture itself tells its format.
        let mut reader = ImageReader::new(Cursor::new(message.data)).with_guessed_format().ok()?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(SIDE_LIMIT);
        limits.max_image_height = Some(SIDE_LIMIT);
        limits.max_alloc = Some(DECODE_LIMIT);
        reader.limits(limits);
        Some(reader.decode().ok()?.into_rgb8())
    } else {
        pixels(&cdr::decode(message).ok()?)
    }
}

/// The pixels of an uncompressed picture.
fn pixels(message: &Image<'_>) -> Option<RgbImage> {
    let (bytes, rgb): (usize, [usize; 3]) = match message.encoding.as_str() {
        "rgb8" => (3, [0, 1, 2]),
        "bgr8" => (3, [2, 1, 0]),
        "rgba8" => (4, [0, 1, 2]),
        "bgra8" => (4, [2, 1, 0]),
        "mono8" | "8UC1" => (1, [0, 0, 0]),
        _ => return None,
    };
    let (width, height, step) = (message.width as usize, message.height as usize, message.step as usize);
    let fits = message.width <= SIDE_LIMIT && message.height <= SIDE_LIMIT && step >= width * bytes;
    let rows = message.data.get(..step.checked_mul(height)?).filter(|_| fits && width > 0)?;
    let mut picture = Vec::with_capacity(width * height * 3);
    for row in rows.chunks_exact(step) {
        for pixel in row[..width * bytes].chunks_exact(bytes) {
            picture.extend(rgb.map(|channel| pixel[channel]));
        }
    }
    RgbImage::from_raw(message.width, message.height, picture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_messages::msg::HeaderMsg;

    fn image(encoding: &str, width: u32, step: u32, data: &[u8]) -> Vec<u8> {
        let height = data.len() as u32 / step.max(1);
        let encoding = encoding.to_owned();
        cdr::encode(&Image { header: HeaderMsg::default(), height, width, encoding, is_bigendian: 0, step, data })
            .unwrap()
    }

    #[test]
    fn layouts_come_to_the_same_picture() {
        let wanted = [1, 2, 3, 4, 5, 6];
        for message in [
            image("rgb8", 2, 6, &[1, 2, 3, 4, 5, 6]),
            image("bgr8", 2, 6, &[3, 2, 1, 6, 5, 4]),
            image("rgba8", 2, 8, &[1, 2, 3, 9, 4, 5, 6, 9]),
            image("bgra8", 2, 8, &[3, 2, 1, 9, 6, 5, 4, 9]),
            image("rgb8", 2, 8, &[1, 2, 3, 4, 5, 6, 0, 0]),
        ] {
            assert_eq!(decode(&message, false).unwrap().into_raw(), wanted);
        }
        assert_eq!(decode(&image("mono8", 2, 2, &[7, 8]), false).unwrap().into_raw(), [7, 7, 7, 8, 8, 8]);
        for bad in [image("rgb8", 3, 6, &[0; 6]), image("yuv422", 2, 4, &[0; 8]), image("rgb8", 0, 0, &[]), vec![0, 1]]
        {
            assert!(decode(&bad, false).is_none());
        }
    }

    #[test]
    fn a_panorama_needs_four_pictures_of_one_instant() {
        let mut cameras = Cameras::new(0.05);
        let picture = || image("mono8", 1, 1, &[7]);
        let ms = 1_000_000;
        for camera in 0..3 {
            cameras.push(camera, 1000 * ms, picture(), false);
        }
        assert!(!cameras.is_settled(990 * ms));
        assert!(cameras.take_panorama(1000 * ms).is_none());
        cameras.push(3, 1040 * ms, picture(), false);
        assert!(cameras.is_settled(1000 * ms) && !cameras.is_settled(1001 * ms));
        assert!(cameras.take_panorama(900 * ms).is_none());
        assert!(cameras.take_panorama(1000 * ms).unwrap().is_ok());
        assert!(cameras.take_panorama(1000 * ms).is_none(), "each picture is used once");
        for camera in 0..4 {
            let message = if camera == 2 { image("mono8", 2, 2, &[7, 7]) } else { picture() };
            cameras.push(camera, 2000 * ms, message, false);
        }
        assert_eq!(cameras.take_panorama(2000 * ms).unwrap().unwrap_err(), Dropped::PictureShape);
    }
}
