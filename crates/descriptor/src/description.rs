//! What a model needs besides its ONNX file: the size of its input, how its output is pooled, what
//! is subtracted, and the cosine from which two places are the same.

use fht_proto::Descriptor;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How pixels enter the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InputLayout {
    /// `uint8 [n, height, width, 3]`, RGB; the network normalises.
    NhwcU8,
    /// `float32 [n, 3, height, width]`, RGB, minus [`Description::input_mean`], divided by
    /// [`Description::input_deviation`].
    NchwF32,
}

/// The description of a model, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Name for people.
    pub name: String,
    /// BLAKE3 hash of the ONNX file, in hexadecimal; another file is refused. None: not checked,
    /// but the model's id, which a map names, follows from the file all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub onnx_blake3: Option<String>,
    /// Name of the network's input.
    pub input: String,
    /// Layout of the input.
    pub layout: InputLayout,
    /// For `nchw-f32`: mean of each colour, 0 to 255.
    #[serde(default)]
    pub input_mean: [f32; 3],
    /// For `nchw-f32`: deviation of each colour, 0 to 255.
    #[serde(default = "unit_deviation")]
    pub input_deviation: [f32; 3],
    /// Width of a panorama as the network sees it, unrolled to a strip (`cylinder`), pixels. None:
    /// the network sees the four views one by one, each `view_px` wide and high.
    #[serde(default)]
    pub panorama_px: Option<u32>,
    /// Side of a single picture as the network sees it, pixels.
    pub view_px: u32,
    /// Name of the network's output: `float32 [n, channels, …]`.
    pub output: String,
    /// Channels of the output.
    pub channels: u16,
    /// Power of the generalised mean.
    pub gem_power: f64,
    /// The mean of all places, `channels` numbers: subtracted from the pooled unit vector. Empty:
    /// nothing is subtracted.
    #[serde(default)]
    pub mean: Vec<f32>,
    /// Name of a file next to this description with a matrix of `dimension` rows and `channels`
    /// columns, little-endian `f32`, that is applied then. None: no matrix.
    #[serde(default)]
    pub projection: Option<String>,
    /// Length of a descriptor; without a projection this equals `channels`.
    pub dimension: u16,
    /// Largest component of the pooled unit vector that the intervals of I(φ) cover, in units of
    /// 1/√channels.
    #[serde(default = "default_information_range")]
    pub information_range: f64,
    /// Smallest cosine of two descriptors of one place.
    pub match_threshold: f32,
}

/// Most channels that a network may have.
const MAX_CHANNELS: u16 = 4096;

fn default_information_range() -> f64 {
    4.0
}

fn unit_deviation() -> [f32; 3] {
    [1.0; 3]
}

/// Why a description is rejected.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// The text is not the JSON of a description.
    #[error("not a model description: {0}")]
    Json(#[from] serde_json::Error),
    /// A value is out of range.
    #[error("{field} is {value}: {expected}")]
    Value {
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
        /// The values allowed.
        expected: &'static str,
    },
}

impl Description {
    /// Parses and checks a description.
    ///
    /// # Errors
    /// [`DescriptionError`].
    pub fn parse(text: &str) -> Result<Self, DescriptionError> {
        let description: Self = serde_json::from_str(text)?;
        let check = |holds: bool, field, value: String, expected| {
            if holds { Ok(()) } else { Err(DescriptionError::Value { field, value, expected }) }
        };
        let dimension = usize::from(description.dimension);
        let shown = |value: &dyn std::fmt::Display| value.to_string();
        check((1..=Descriptor::MAX_DIMENSION).contains(&dimension), "dimension", shown(&dimension), "1 to 512")?;
        let channels = usize::from(description.channels);
        check((1..=MAX_CHANNELS).contains(&description.channels), "channels", shown(&channels), "1 to 4096")?;
        match &description.projection {
            None => {
                check(dimension == channels, "dimension", shown(&dimension), "as many as channels, or a projection")?;
            }
            Some(name) => {
                let is_name = Path::new(name).file_name().is_some_and(|file| file == name.as_str());
                check(is_name, "projection", name.clone(), "the name of a file beside the description")?;
            }
        }
        let range = description.information_range;
        check((0.1..=100.0).contains(&range), "information_range", shown(&range), "0.1 to 100")?;
        let panorama_px = description.panorama_px.unwrap_or(64);
        check((64..=4096).contains(&panorama_px), "panorama_px", shown(&panorama_px), "64 to 4096 pixels, or null")?;
        let view_px = description.view_px;
        check((16..=1024).contains(&view_px), "view_px", shown(&view_px), "16 to 1024 pixels")?;
        let power = description.gem_power;
        check(power.is_finite() && (0.5..=20.0).contains(&power), "gem_power", shown(&power), "0.5 to 20")?;
        let mean = &description.mean;
        let fits = mean.is_empty() || mean.len() == channels;
        check(fits, "mean", format!("{} numbers", mean.len()), "one number for each channel, or none")?;
        check(mean.iter().all(|value| value.is_finite()), "mean", "not finite".to_owned(), "finite numbers")?;
        let deviation = description.input_deviation;
        let is_deviation = deviation.iter().all(|value| value.is_finite() && *value > 0.0);
        check(is_deviation, "input_deviation", format!("{deviation:?}"), "positive numbers")?;
        let threshold = description.match_threshold;
        check((-1.0..=1.0).contains(&threshold), "match_threshold", shown(&threshold), "a cosine")?;
        check(description.name.len() <= 64, "name", description.name.clone(), "at most 64 bytes")?;
        Ok(description)
    }
}
