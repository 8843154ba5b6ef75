//! A network in ONNX Runtime.

use super::{Features, LoadError, planes};
use crate::description::{Description, InputLayout};
use crate::error::DescribeError;
use crate::runtime::{self, Fetching};
use image::RgbImage;
use ort::session::Session;
use ort::value::{Outlet, TensorRef};

/// A loaded network.
pub(crate) struct Network {
    session: Session,
    description: Description,
}

impl Network {
    pub fn load(onnx: &[u8], description: &Description, fetching: Fetching) -> Result<Self, LoadError> {
        let environment = runtime::environment(fetching).map_err(LoadError::Runtime)?;
        let model_error = |error: ort::Error| LoadError::Model(error.to_string());
        // One thread: the network runs next to the robot's loop, and a fixed order of additions
        // gives the same numbers each time.
        let mut builder = Session::builder(environment)
            .and_then(|builder| Ok(builder.with_intra_threads(1)?))
            .map_err(model_error)?;
        let session = builder.commit_from_memory(onnx).map_err(model_error)?;
        let has = |outlets: &[Outlet], name: &str| outlets.iter().any(|outlet| outlet.name() == name);
        if !has(session.inputs(), &description.input) {
            return Err(LoadError::Model(format!("it has no input '{}'", description.input)));
        }
        if !has(session.outputs(), &description.output) {
            return Err(LoadError::Model(format!("it has no output '{}'", description.output)));
        }
        Ok(Self { session, description: description.clone() })
    }

    /// Runs one picture.
    pub fn features(&mut self, picture: &RgbImage) -> Result<Features, DescribeError> {
        let network_error = |error: ort::Error| DescribeError::Network(error.to_string());
        let (width, height) = (i64::from(picture.width()), i64::from(picture.height()));
        let description = &self.description;
        let planes_of_picture: Vec<f32>;
        let outputs = match description.layout {
            InputLayout::NhwcU8 => {
                let tensor = TensorRef::from_array_view((vec![1, height, width, 3], picture.as_raw().as_slice()))
                    .map_err(network_error)?;
                self.session.run(vec![(description.input.as_str(), tensor)])
            }
            InputLayout::NchwF32 => {
                planes_of_picture = planes(picture, description);
                let tensor = TensorRef::from_array_view((vec![1, 3, height, width], planes_of_picture.as_slice()))
                    .map_err(network_error)?;
                self.session.run(vec![(description.input.as_str(), tensor)])
            }
        }
        .map_err(network_error)?;
        let output = outputs
            .get(&description.output)
            .ok_or_else(|| DescribeError::Network(format!("no output '{}'", description.output)))?;
        let (shape, values) = output.try_extract_tensor::<f32>().map_err(network_error)?;
        let shape: Vec<usize> = shape.iter().map(|&size| usize::try_from(size).unwrap_or(0)).collect();
        Features::new(&shape, values.to_vec(), description)
    }
}
