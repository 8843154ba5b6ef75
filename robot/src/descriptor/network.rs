//! One network: in ONNX Runtime, or with the feature `tract` in pure Rust.

#[cfg(not(feature = "tract"))]
mod onnx_runtime;
#[cfg(feature = "tract")]
mod pure_rust;

#[cfg(not(feature = "tract"))]
pub(super) use onnx_runtime::Network;
#[cfg(feature = "tract")]
pub(super) use pure_rust::Network;

use super::DescribeError;
use super::description::Description;
use super::runtime::RuntimeError;
use image::RgbImage;

/// The network's output for one picture: `channels` planes of `rows` × `columns`, one after the other.
pub(super) struct Features {
    pub channels: usize,
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f32>,
}

impl Features {
    /// Takes an output `[1, channels, rows, columns]` or `[1, channels]`.
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

/// Why a network was not loaded.
pub(super) enum LoadError {
    /// There is no ONNX Runtime.
    #[cfg_attr(feature = "tract", expect(dead_code, reason = "pure Rust needs no library"))]
    Runtime(RuntimeError),
    /// The model is refused.
    Model(String),
}

/// The picture as `[3, height, width]`, as [`Description::input_mean`] and `input_deviation` say.
fn planes(picture: &RgbImage, description: &Description) -> Vec<f32> {
    let normal = |(channel, value): (usize, u8)| {
        (f32::from(value) - description.input_mean[channel]) / description.input_deviation[channel]
    };
    (0..3).flat_map(|channel| picture.pixels().map(move |pixel| (channel, pixel.0[channel]))).map(normal).collect()
}
