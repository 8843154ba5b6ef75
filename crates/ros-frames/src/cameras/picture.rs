//! The pixels of a message, and back.

use fht_ros_messages::cdr;
use fht_ros_messages::msg::{CompressedImage, Image};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageReader, Limits, RgbImage};
use std::io::Cursor;

/// Longest side of a picture, pixels.
const SIDE_LIMIT: u32 = 8192;
/// Most memory that decoding a picture may take, bytes.
const DECODE_LIMIT: u64 = 512 << 20;

/// Why a message is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PictureRefused {
    /// It is no message of its type.
    #[error("its messages cannot be read: {0}")]
    Message(String),
    /// Its pixels are laid out in a way that is not read.
    #[error(
        "its encoding is {0:?}, and rgb8, bgr8, rgba8, bgra8 and mono8 are read: let its driver, or image_proc, give one of \
         them"
    )]
    Encoding(String),
    /// Its size and its data do not fit together.
    #[error("{width} x {height} pixels in rows of {step} bytes are not what its {bytes} bytes are")]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes a row.
        step: u32,
        /// Bytes there are.
        bytes: usize,
    },
    /// It is no JPEG or PNG, or a broken one.
    #[error("its pictures cannot be decoded ({0}): PNG and JPEG are read")]
    Undecodable(String),
}

/// The picture in a message in CDR: `sensor_msgs/CompressedImage`, or `sensor_msgs/Image`.
///
/// # Errors
/// [`PictureRefused`].
pub fn picture_of(message: &[u8], is_compressed: bool) -> Result<RgbImage, PictureRefused> {
    let unreadable = |error: cdr::CdrError| PictureRefused::Message(error.to_string());
    if !is_compressed {
        return pixels(&cdr::decode(message).map_err(unreadable)?);
    }
    let message: CompressedImage<'_> = cdr::decode(message).map_err(unreadable)?;
    let undecodable = |error: String| PictureRefused::Undecodable(error);
    // `format` has many spellings; the picture itself tells its format.
    let reader = ImageReader::new(Cursor::new(message.data)).with_guessed_format();
    let mut reader = reader.map_err(|error| undecodable(error.to_string()))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_LIMIT);
    limits.max_image_height = Some(SIDE_LIMIT);
    limits.max_alloc = Some(DECODE_LIMIT);
    reader.limits(limits);
    Ok(reader.decode().map_err(|error| undecodable(error.to_string()))?.into_rgb8())
}

/// The pixels of an uncompressed picture.
fn pixels(message: &Image<'_>) -> Result<RgbImage, PictureRefused> {
    let (bytes, rgb): (usize, [usize; 3]) = match message.encoding.as_str() {
        "rgb8" => (3, [0, 1, 2]),
        "bgr8" => (3, [2, 1, 0]),
        "rgba8" => (4, [0, 1, 2]),
        "bgra8" => (4, [2, 1, 0]),
        "mono8" | "8UC1" => (1, [0, 0, 0]),
        other => return Err(PictureRefused::Encoding(other.chars().take(40).collect())),
    };
    let Image { width, height, step, .. } = *message;
    let refused = || PictureRefused::Size { width, height, step, bytes: message.data.len() };
    let (columns, row_bytes) = (width as usize, step as usize);
    let fits = width <= SIDE_LIMIT && height <= SIDE_LIMIT && columns > 0 && row_bytes >= columns * bytes;
    let all_bytes = row_bytes.checked_mul(height as usize).filter(|_| fits).ok_or_else(refused)?;
    let rows = message.data.get(..all_bytes).ok_or_else(refused)?;
    let mut picture = Vec::with_capacity(columns * height as usize * 3);
    for row in rows.chunks_exact(row_bytes) {
        for pixel in row[..columns * bytes].chunks_exact(bytes) {
            picture.extend(rgb.map(|channel| pixel[channel]));
        }
    }
    RgbImage::from_raw(width, height, picture).ok_or_else(refused)
}

/// How a picture is made smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Without loss.
    Png,
    /// As cameras do.
    Jpeg,
}

impl Compression {
    /// What `image_transport` writes into `sensor_msgs/CompressedImage` as the format.
    #[must_use]
    pub fn format(self) -> &'static str {
        match self {
            Self::Png => "rgb8; png compressed rgb8",
            Self::Jpeg => "rgb8; jpeg compressed bgr8",
        }
    }
}

/// A picture as a file.
///
/// # Errors
/// What the encoder says, in words.
pub fn compress(picture: &RgbImage, compression: Compression) -> Result<Vec<u8>, String> {
    /// The usual one of `image_transport`.
    const JPEG_QUALITY: u8 = 95;
    let mut bytes = Vec::new();
    let (width, height) = picture.dimensions();
    let written = match compression {
        Compression::Png => PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(picture, width, height, ExtendedColorType::Rgb8),
        Compression::Jpeg => JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).write_image(
            picture,
            width,
            height,
            ExtendedColorType::Rgb8,
        ),
    };
    written.map_err(|error| error.to_string())?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fht_ros_messages::msg::HeaderMsg;

    fn message(encoding: &str, width: u32, step: u32, data: &[u8]) -> Vec<u8> {
        let height = data.len() as u32 / step.max(1);
        let encoding = encoding.to_owned();
        let image = Image { header: HeaderMsg::default(), height, width, encoding, is_bigendian: 0, step, data };
        cdr::encode(&image).expect("a message")
    }

    fn compressed(data: &[u8]) -> Vec<u8> {
        let header = HeaderMsg::default();
        cdr::encode(&CompressedImage { header, format: "jpeg".to_owned(), data }).expect("a message")
    }

    #[test]
    fn layouts_come_to_the_same_picture() {
        let wanted = [1, 2, 3, 4, 5, 6];
        for message in [
            message("rgb8", 2, 6, &[1, 2, 3, 4, 5, 6]),
            message("bgr8", 2, 6, &[3, 2, 1, 6, 5, 4]),
            message("rgba8", 2, 8, &[1, 2, 3, 9, 4, 5, 6, 9]),
            message("bgra8", 2, 8, &[3, 2, 1, 9, 6, 5, 4, 9]),
            message("rgb8", 2, 8, &[1, 2, 3, 4, 5, 6, 0, 0]),
        ] {
            assert_eq!(picture_of(&message, false).map(RgbImage::into_raw).as_deref(), Ok(&wanted[..]));
        }
        let grey = picture_of(&message("mono8", 2, 2, &[7, 8]), false).map(RgbImage::into_raw);
        assert_eq!(grey.as_deref(), Ok(&[7, 7, 7, 8, 8, 8][..]));
    }

    #[test]
    fn what_is_no_picture_is_told() {
        let said = |message: &[u8], is_compressed| {
            picture_of(message, is_compressed).err().map(|refusal| refusal.to_string()).unwrap_or_default()
        };
        assert!(said(&message("rgb8", 3, 6, &[0; 6]), false).contains("rows of 6 bytes"));
        assert!(said(&message("rgb8", 0, 0, &[]), false).contains("0 x 0"));
        assert!(said(&message("bayer_rggb8", 2, 2, &[0; 4]), false).contains("\"bayer_rggb8\""));
        assert!(said(&[0, 1], false).contains("cannot be read"));
        assert!(said(&compressed(b"no picture"), true).contains("cannot be decoded"));
        // A PNG that claims to be enormous costs nothing.
        let mut png = compress(&RgbImage::new(2, 2), Compression::Png).expect("a picture");
        assert!(picture_of(&compressed(&png), true).is_ok());
        png[16..20].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff]);
        assert!(said(&compressed(&png), true).contains("cannot be decoded"));
    }

    #[test]
    fn what_is_compressed_is_read() {
        let wanted = RgbImage::from_pixel(16, 16, image::Rgb([200, 100, 50]));
        for (compression, off) in [(Compression::Png, 0), (Compression::Jpeg, 4)] {
            let bytes = compress(&wanted, compression).expect("a picture");
            let picture = picture_of(&compressed(&bytes), true).expect("a picture");
            assert_eq!(picture.dimensions(), (16, 16));
            let mut pairs = picture.iter().zip(wanted.iter());
            assert!(pairs.all(|(value, wanted)| value.abs_diff(*wanted) <= off), "{compression:?}");
        }
    }
}
