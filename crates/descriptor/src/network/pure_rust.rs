//! A network in pure Rust: no library to find, several times slower.

use super::{Features, LoadError, planes};
use crate::description::{Description, InputLayout};
use crate::error::DescribeError;
use crate::runtime::Fetching;
use image::RgbImage;
use std::collections::BTreeMap;
use std::sync::Arc;
use tract_onnx::prelude::*;

/// A network prepared for one size of picture.
type Plan = Arc<TypedRunnableModel>;

/// A loaded network.
pub(crate) struct Network {
    model: InferenceModel,
    /// By width and height. A model sees at most two sizes: that of a panorama and that of a single
    /// picture.
    plans: BTreeMap<(u32, u32), Plan>,
    description: Description,
}

impl Network {
    pub fn load(onnx: &[u8], description: &Description, _: Fetching) -> Result<Self, LoadError> {
        let model_error = |error: TractError| LoadError::Model(format!("{error:#}"));
        let mut reader = onnx;
        let mut model = tract_onnx::onnx()
            .with_ignore_value_info(true)
            .with_ignore_output_shapes(true)
            .model_for_read(&mut reader)
            .map_err(model_error)?;
        let input = model.input_outlets().map_err(model_error)?.first().map(|outlet| outlet.node);
        if input.is_none_or(|node| model.node(node).name != description.input) {
            return Err(LoadError::Model(format!("it has no input '{}'", description.input)));
        }
        model
            .select_outputs_by_name([description.output.as_str()])
            .map_err(|_| LoadError::Model(format!("it has no output '{}'", description.output)))?;
        Ok(Self { model, plans: BTreeMap::new(), description: description.clone() })
    }

    /// Runs one picture.
    pub fn features(&mut self, picture: &RgbImage) -> Result<Features, DescribeError> {
        let network_error = |error: TractError| DescribeError::Network(format!("{error:#}"));
        let tensor = self.input(picture).map_err(network_error)?;
        let plan = self.plan(picture.dimensions(), &tensor).map_err(network_error)?;
        let outputs = plan.run(tvec!(tensor.into())).map_err(network_error)?;
        let output = outputs.first().ok_or_else(|| DescribeError::Network("no output".to_owned()))?;
        let values =
            output.try_as_plain_ram().and_then(|plain| Ok(plain.as_slice::<f32>()?.to_vec())).map_err(network_error)?;
        Features::new(output.shape(), values, &self.description)
    }

    fn input(&self, picture: &RgbImage) -> TractResult<Tensor> {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        match self.description.layout {
            InputLayout::NhwcU8 => Tensor::from_shape(&[1, height, width, 3], picture.as_raw()),
            InputLayout::NchwF32 => Tensor::from_shape(&[1, 3, height, width], &planes(picture, &self.description)),
        }
    }

    fn plan(&mut self, size: (u32, u32), tensor: &Tensor) -> TractResult<Plan> {
        if let Some(plan) = self.plans.get(&size) {
            return Ok(plan.clone());
        }
        let fact = InferenceFact::dt_shape(tensor.datum_type(), tensor.shape());
        let plan = self.model.clone().with_input_fact(0, fact)?.into_optimized()?.into_runnable()?;
        self.plans.insert(size, plan.clone());
        Ok(plan)
    }
}
