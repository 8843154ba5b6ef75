//! One network in ONNX Runtime.

use super::DescribeError;
use super::description::{Description, InputLayout};
use image::RgbImage;
use ort::environment::Environment;
use ort::session::Session;
use ort::value::{Outlet, TensorRef};

/// The network's output for one picture: `channels` planes of `rows` × `columns`, one after the other.
pub(super) struct Features {
    pub channels: usize,
    pub rows: usize,
    pub columns: usize,
    pub values: Vec<f32>,
}

/// A loaded network.
pub(super) struct Network {
    session: Session,
    description: Description,
}

impl Network {
    pub fn load(environment: &Environment, onnx: &[u8], description: &Description) -> Result<Self, String> {
        // One thread: it runs beside the robot's loop, and a fixed order of additions gives the same numbers.
        let mut builder =
            Session::builder(environment).and_then(|builder| Ok(builder.with_intra_threads(1)?)).map_err(text)?;
        let session = builder.commit_from_memory(onnx).map_err(text)?;
        let has = |names: Vec<&str>, name: &str| names.contains(&name);
        if !has(session.inputs().iter().map(Outlet::name).collect(), &description.input) {
            return Err(format!("it has no input '{}'", description.input));
        }
        if !has(session.outputs().iter().map(Outlet::name).collect(), &description.output) {
            return Err(format!("it has no output '{}'", description.output));
        }
        Ok(Self { session, description: description.clone() })
    }

    /// Runs one picture.
    pub fn features(&mut self, view: &RgbImage) -> Result<Features, DescribeError> {
        let network_error = |error: ort::Error| DescribeError::Network(text(error));
        let (width, height) = (i64::from(view.width()), i64::from(view.height()));
        let description = &self.description;
        let planes: Vec<f32>;
        let outputs = match description.layout {
            InputLayout::NhwcU8 => {
                let tensor = TensorRef::from_array_view((vec![1, height, width, 3], view.as_raw().as_slice()))
                    .map_err(network_error)?;
                self.session.run(vec![(description.input.as_str(), tensor)])
            }
            InputLayout::NchwF32 => {
                planes = (0..3)
                    .flat_map(|channel| view.pixels().map(move |pixel| (channel, pixel.0[channel])))
                    .map(|(channel, value)| {
                        (f32::from(value) - description.input_mean[channel]) / description.input_deviation[channel]
                    })
                    .collect();
                let tensor = TensorRef::from_array_view((vec![1, 3, height, width], planes.as_slice()))
                    .map_err(network_error)?;
                self.session.run(vec![(description.input.as_str(), tensor)])
            }
        }
        .map_err(network_error)?;
        let output = outputs
            .get(&description.output)
            .ok_or_else(|| DescribeError::Network(format!("no output '{}'", description.output)))?;
        let (shape, values) = output.try_extract_tensor::<f32>().map_err(network_error)?;
        let size = |axis: usize| shape.get(axis).map_or(1, |&size| usize::try_from(size).unwrap_or(0));
        let features = Features { channels: size(1), rows: size(2), columns: size(3), values: values.to_vec() };
        let channels = usize::from(description.channels);
        let counted = channels * features.rows * features.columns;
        if features.channels != channels || counted != features.values.len() || counted == 0 {
            let expected = format!("[1, {channels}, rows, columns]");
            return Err(DescribeError::Output { found: format!("{shape:?}"), expected });
        }
        Ok(features)
    }
}

fn text(error: ort::Error) -> String {
    error.to_string()
}
