//! One network: in ONNX Runtime, or with the feature `tract` in pure Rust.

#[cfg(not(feature = "tract"))]
mod onnx_runtime;
#[cfg(feature = "tract")]
mod pure_rust;

#[cfg(not(feature = "tract"))]
pub(crate) use onnx_runtime::Network;
#[cfg(feature = "tract")]
pub(crate) use pure_rust::Network;

use crate::description::Description;
use crate::error::DescribeError;
use crate::runtime::RuntimeError;
use image::RgbImage;

/// The network's output for one picture: `channels` planes of `rows` × `columns`, one after the
/// other.
pub(crate) struct Features {
    pub channels: usize,
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f32>,
}

impl Features {
    /// Checks an output of shape `[1, channels, rows, columns]` or `[1, channels]`.
    fn new(shape: &[usize], values: Vec<f32>, description: &Description) -> Result<Self, DescribeError> {
        let size = |axis: usize| shape.get(axis).copied().unwrap_or(1);
        let features = Self { channels: size(1), rows: size(2), columns: size(3), values };
        let channels = usize::from(description.channels);
        let counted = channels * features.rows * features.columns;
        if features.channels != channels || counted != features.values.len() || counted == 0 {
            let expected = format!("[1, {channels}, rows, columns]");
            return Err(DescribeError::Output { found: format!("{shape:?}"), expected });
        }
        Ok(features)
    }
}

/// Why a network cannot be loaded.
pub(crate) enum LoadError {
    /// The ONNX Runtime library was not found.
    #[cfg_attr(feature = "tract", expect(dead_code, reason = "pure Rust needs no library"))]
    Runtime(RuntimeError),
    /// The model is rejected.
    Model(String),
}

/// The picture as `[3, height, width]`, normalised by [`Description::input_mean`] and
/// `input_deviation`.
fn planes(picture: &RgbImage, description: &Description) -> Vec<f32> {
    let normal = |(channel, value): (usize, u8)| {
        (f32::from(value) - description.input_mean[channel]) / description.input_deviation[channel]
    };
    (0..3).flat_map(|channel| picture.pixels().map(move |pixel| (channel, pixel.0[channel]))).map(normal).collect()
}
