//! The visual descriptor φ: a CNN over the panorama, pooled into a unit vector that does not depend on the heading.
//!
//! | module | idea |
//! | --- | --- |
//! | [`description`] | what a model needs beside its ONNX file |
//! | [`cylinder`] | the panorama as a strip without a seam |
//! | [`projection`] | what tells places apart |
//! | [`light`] | the same place in another light gives nearly the same pixels |
//! | [`runtime`] | finding the ONNX Runtime library without the user's help |
//!
//! The panorama is unrolled to a strip that goes around, so that there is no seam and a turn of the robot is a shift;
//! what the network says of the strip is pooled over all of it (GeM: Radenović et al., TPAMI 2018). The pooled vector is
//! made a unit vector, a mean that all places share is subtracted, the rest is projected on what tells places apart, and
//! made a unit vector again. A model with a fixed input gets the four views one by one instead, pooled together.

pub mod cylinder;
pub mod description;
mod files;
pub mod light;
mod network;
mod pool;
pub mod projection;
pub mod runtime;

use crate::frame::Panorama;
use description::{Description, DescriptionError};
use fht_proto::{Descriptor, DescriptorModel, ModelId};
use files::ModelFiles;
use image::RgbImage;
use image::imageops::{FilterType, resize};
use network::{LoadError, Network};
use pool::{GemPool, make_unit};
use projection::{Projection, ProjectionError};
use runtime::RuntimeError;
use std::path::{Path, PathBuf};

/// Why a model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DescriptorError {
    /// A file cannot be read.
    #[error("{path} cannot be read: {source}", path = path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The description makes no sense.
    #[error("{path}: {source}", path = path.display())]
    Description {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        source: DescriptionError,
    },
    /// The projection does not fit the description.
    #[error("{path}: {source}", path = path.display())]
    Projection {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        source: ProjectionError,
    },
    /// There is no ONNX Runtime.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// The runtime refuses the model.
    #[error("{path} cannot be loaded as an ONNX model: {reason}", path = path.display())]
    Model {
        /// Which file.
        path: PathBuf,
        /// What the runtime says.
        reason: String,
    },
}

/// Why a panorama was not described.
#[derive(Debug, thiserror::Error)]
pub enum DescribeError {
    /// A view without pixels, or no view.
    #[error("there is no picture to describe")]
    Empty,
    /// The network failed.
    #[error("the network failed: {0}")]
    Network(String),
    /// The network's output is not what its description says.
    #[error("the network gave {found}, its description says {expected}")]
    Output {
        /// What came.
        found: String,
        /// What should have come.
        expected: String,
    },
}

/// What the cameras say of a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    /// The unit vector φ.
    pub components: Vec<f32>,
    /// Its visual information I(φ) (paper, equation 2), as a share of the greatest possible, 0 to 1.
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
    /// Loads the built-in model, or the ONNX file `model`, whose description lies beside it with the ending `.json`.
    ///
    /// # Errors
    /// [`DescriptorError`] says which file is at fault and why, or what to do when there is no ONNX Runtime.
    pub fn load(model: Option<&Path>) -> Result<Self, DescriptorError> {
        match model {
            None => Self::from_files(&files::built_in()),
            Some(onnx) => Self::from_files(&files::read(onnx)?),
        }
    }

    fn from_files(files: &ModelFiles<'_>) -> Result<Self, DescriptorError> {
        let description = Description::parse(&files.description.contents)
            .map_err(|source| DescriptorError::Description { path: files.description.path.clone(), source })?;
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
        let network = Network::load(&files.onnx.contents, &description).map_err(|error| match error {
            LoadError::Runtime(error) => DescriptorError::Runtime(error),
            LoadError::Model(reason) => DescriptorError::Model { path: files.onnx.path.clone(), reason },
        })?;
        Ok(Self { network, description, projection, model })
    }

    /// The model, as it travels with a map.
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

    /// Describes a panorama, and how much there is to see.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn appearance(&mut self, panorama: &Panorama) -> Result<Appearance, DescribeError> {
        let pooled = self.pooled(panorama)?;
        Ok(self.refine(pooled))
    }

    /// Describes what any number of pictures of one place show: for places without a panorama. A panorama's descriptor
    /// is another one.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn picture_appearance(&mut self, pictures: &[RgbImage]) -> Result<Appearance, DescribeError> {
        let pooled = self.pooled_pictures(pictures)?;
        Ok(self.refine(pooled))
    }

    /// The pooled features of a panorama before the mean is subtracted: a unit vector of as many numbers as the network
    /// has channels, none negative. What mean and projection are fitted on.
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

/// Entropy of a pooled unit vector's components (paper, equation 2), as a share of the greatest possible.
///
/// The paper divides `[0, 1]` into equal intervals, but the components of a unit vector of n numbers are about 1/√n,
/// and nearly all would fall into the first; here 20 intervals divide `[0, range/√n]`.
#[must_use]
pub fn information(pooled: &[f32], range: f64) -> f64 {
    const INTERVALS: usize = 20;
    let mut histogram = [0_usize; INTERVALS];
    let scale = (pooled.len() as f64).sqrt() / range * INTERVALS as f64;
    for &component in pooled {
        let interval = (f64::from(component).max(0.0) * scale) as usize;
        histogram[interval.min(INTERVALS - 1)] += 1;
    }
    let entropy: f64 = histogram
        .iter()
        .filter(|&&count| count > 0)
        .map(|&count| count as f64 / pooled.len() as f64)
        .map(|share| -share * share.log2())
        .sum();
    entropy / (INTERVALS as f64).log2()
}

#[cfg(test)]
mod tests;
