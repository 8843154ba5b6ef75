//! From a panorama to its descriptor: unroll, normalise the light, run the network, pool, project.

use crate::description::Description;
use crate::error::{DescribeError, DescriptorError};
use crate::files::{self, ModelFiles};
use crate::information::information;
use crate::network::{LoadError, Network};
use crate::pool::{GemPool, make_unit};
use crate::projection::Projection;
use crate::runtime::Fetching;
use crate::{cylinder, light};
use fht_perception::frame::Panorama;
use fht_proto::{Descriptor, DescriptorModel, ModelId};
use image::RgbImage;
use image::imageops::{FilterType, resize};
use std::path::Path;

/// What a place looks like.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    /// The unit vector φ.
    pub components: Vec<f32>,
    /// Its visual information I(φ) (paper, equation 2), as a share of the greatest possible, 0 to
    /// 1.
    pub information: f64,
}

/// A network with its description.
pub struct DescriptorNet {
    network: Network,
    description: Description,
    projection: Option<Projection>,
    model: DescriptorModel,
}

impl DescriptorNet {
    /// Loads the built-in model, or the ONNX file `model`, whose description lies next to it with
    /// the extension `.json`. A missing ONNX Runtime is fetched.
    ///
    /// # Errors
    /// [`DescriptorError`] names the file at fault and why, or says what to do if there is no ONNX
    /// Runtime.
    pub fn load(model: Option<&Path>) -> Result<Self, DescriptorError> {
        Self::load_with(model, Fetching::Allowed)
    }

    /// Loads a model as [`load`](Self::load) does, and says whether a missing ONNX Runtime may be
    /// fetched.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_with(model: Option<&Path>, fetching: Fetching) -> Result<Self, DescriptorError> {
        match model {
            None => Self::from_files(&files::built_in(), fetching),
            Some(onnx) => Self::from_files(&files::read(onnx)?, fetching),
        }
    }

    fn from_files(files: &ModelFiles<'_>, fetching: Fetching) -> Result<Self, DescriptorError> {
        let description = Description::parse(&files.description.contents)
            .map_err(|source| DescriptorError::Description { path: files.description.path.clone(), source })?;
        if let Some(expected) = &description.onnx_blake3 {
            let found = blake3::hash(&files.onnx.contents).to_hex().to_string();
            if found != *expected {
                let expected = expected.clone();
                return Err(DescriptorError::Altered { path: files.onnx.path.clone(), found, expected });
            }
        }
        let (channels, dimension) = (usize::from(description.channels), usize::from(description.dimension));
        let mut hash = blake3::Hasher::new();
        hash.update(&files.onnx.contents).update(files.description.contents.as_bytes());
        let projection = match &description.projection {
            None => None,
            Some(name) => {
                let file = files.projection(name)?;
                hash.update(&file.contents);
                let parsed = Projection::parse(&file.contents, channels, dimension);
                Some(parsed.map_err(|source| DescriptorError::Projection { path: file.path, source })?)
            }
        };
        let hash = hash.finalize();
        let id = ModelId(u32::from_be_bytes([0, 1, 2, 3].map(|index| hash.as_bytes()[index])));
        let model = DescriptorModel {
            id,
            name: description.name.clone(),
            dimension: description.dimension,
            match_threshold_e3: (description.match_threshold * 1000.0).round() as i16,
        };
        let network = Network::load(&files.onnx.contents, &description, fetching).map_err(|error| match error {
            LoadError::Runtime(error) => DescriptorError::Runtime(error),
            LoadError::Model(reason) => DescriptorError::Model { path: files.onnx.path.clone(), reason },
        })?;
        Ok(Self { network, description, projection, model })
    }

    /// The model, in the form that travels with a map.
    #[must_use]
    pub fn model(&self) -> &DescriptorModel {
        &self.model
    }

    /// Describes a panorama: a unit vector of [`DescriptorModel::dimension`] numbers.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn describe(&mut self, panorama: &Panorama) -> Result<Vec<f32>, DescribeError> {
        Ok(self.appearance(panorama)?.components)
    }

    /// Describes a panorama and measures how much there is to see.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn appearance(&mut self, panorama: &Panorama) -> Result<Appearance, DescribeError> {
        let pooled = self.pooled(panorama)?;
        Ok(self.refine(pooled))
    }

    /// Describes any number of pictures of one place, for places without a panorama. The result
    /// differs from the descriptor of a panorama.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn picture_appearance(&mut self, pictures: &[RgbImage]) -> Result<Appearance, DescribeError> {
        let pooled = self.pooled_pictures(pictures)?;
        Ok(self.refine(pooled))
    }

    /// The pooled features of a panorama before the mean is subtracted: a unit vector with a number
    /// for each channel of the network, none of them negative. Mean and projection are fitted to
    /// these.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn pooled(&mut self, panorama: &Panorama) -> Result<Vec<f32>, DescribeError> {
        let Some(width_px) = self.description.panorama_px else {
            return self.pooled_pictures(&panorama.views);
        };
        let strip = cylinder::unroll(panorama, width_px).ok_or(DescribeError::Empty)?;
        let mut strip = [strip];
        light::normalise(&mut strip);
        let (closed, margin_px) = cylinder::close(&strip[0]);
        let features = self.network.features(&closed)?;
        let margin = (features.columns as f64 * f64::from(margin_px) / f64::from(closed.width())).round() as usize;
        let mut pool = self.pool();
        pool.add(&features, margin);
        Ok(pool.finish())
    }

    fn pooled_pictures(&mut self, pictures: &[RgbImage]) -> Result<Vec<f32>, DescribeError> {
        if pictures.is_empty() || pictures.iter().any(|picture| picture.width() == 0 || picture.height() == 0) {
            return Err(DescribeError::Empty);
        }
        let side = self.description.view_px;
        let mut pictures: Vec<RgbImage> =
            pictures.iter().map(|picture| resize(picture, side, side, FilterType::Triangle)).collect();
        light::normalise(&mut pictures);
        let mut pool = self.pool();
        for picture in &pictures {
            pool.add(&self.network.features(picture)?, 0);
        }
        Ok(pool.finish())
    }

    fn pool(&self) -> GemPool {
        GemPool::new(usize::from(self.description.channels), self.description.gem_power)
    }

    fn refine(&self, pooled: Vec<f32>) -> Appearance {
        let information = information(&pooled, self.description.information_range);
        let mut components = pooled;
        for (component, mean) in components.iter_mut().zip(&self.description.mean) {
            *component -= mean;
        }
        if let Some(projection) = &self.projection {
            components = projection.apply(&components);
        }
        make_unit(&mut components);
        Appearance { components, information }
    }

    /// Describes a panorama in the form that travels.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn descriptor(&mut self, panorama: &Panorama) -> Result<Descriptor, DescribeError> {
        Ok(Descriptor::quantise(self.model.id, &self.describe(panorama)?))
    }
}
