//! The visual descriptor φ: a CNN over the panorama, pooled into a unit vector that does not depend on the heading.
//!
//! | module | idea |
//! | --- | --- |
//! | [`description`] | what a model needs beside its ONNX file |
//! | [`projection`] | what tells places apart |
//! | [`light`] | the same place in another light gives nearly the same pixels |
//! | [`runtime`] | finding the ONNX Runtime library without the user's help |
//!
//! The four views go through the network one by one and are pooled together (GeM: Radenović et al., TPAMI 2018), so a
//! turn by 90° only permutes them and there is no seam; other turns crop the views elsewhere and change little. The
//! pooled vector is made a unit vector, a mean that all places share is subtracted, the rest is projected on what tells
//! places apart, and made a unit vector again.

pub mod description;
pub mod light;
mod network;
pub mod projection;
pub mod runtime;

use crate::frame::Panorama;
use description::{Description, DescriptionError};
use fht_proto::{Descriptor, DescriptorModel, ModelId};
use image::RgbImage;
use image::imageops::{FilterType, resize};
use network::Network;
use projection::{Projection, ProjectionError};
use runtime::RuntimeError;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The built-in model; see `models/README.md` for its origin and licence.
const BUILT_IN_ONNX: &[u8] = include_bytes!("../../models/mobilenet-v2-b11.onnx");
const BUILT_IN_DESCRIPTION: &str = include_str!("../../models/mobilenet-v2-b11.json");
const BUILT_IN_PROJECTION: &[u8] = include_bytes!("../../models/mobilenet-v2-b11.projection");

/// A file and what is in it.
struct File<T> {
    path: PathBuf,
    contents: T,
}

/// The files of a model.
struct ModelFiles<'a> {
    onnx: File<Cow<'a, [u8]>>,
    description: File<Cow<'a, str>>,
    /// The built-in model's projection; other models' lies beside the description.
    projection: Option<&'a [u8]>,
}

impl ModelFiles<'_> {
    fn projection(&self, name: &str) -> Result<File<Cow<'_, [u8]>>, DescriptorError> {
        let path = self.description.path.with_file_name(name);
        let contents = match self.projection {
            Some(bytes) => Cow::Borrowed(bytes),
            None => Cow::Owned(std::fs::read(&path).map_err(read_error(&path))?),
        };
        Ok(File { path, contents })
    }
}

fn built_in() -> ModelFiles<'static> {
    let path = PathBuf::from("built-in model");
    ModelFiles {
        onnx: File { path: path.clone(), contents: Cow::Borrowed(BUILT_IN_ONNX) },
        description: File { path, contents: Cow::Borrowed(BUILT_IN_DESCRIPTION) },
        projection: Some(BUILT_IN_PROJECTION),
    }
}

fn read(onnx: &Path) -> Result<ModelFiles<'static>, DescriptorError> {
    let description = onnx.with_extension("json");
    let bytes = std::fs::read(onnx).map_err(read_error(onnx))?;
    let text = std::fs::read_to_string(&description).map_err(read_error(&description))?;
    Ok(ModelFiles {
        onnx: File { path: onnx.to_owned(), contents: Cow::Owned(bytes) },
        description: File { path: description, contents: Cow::Owned(text) },
        projection: None,
    })
}

fn read_error(path: &Path) -> impl FnOnce(std::io::Error) -> DescriptorError {
    let path = path.to_owned();
    move |source| DescriptorError::Read { path, source }
}

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
            None => Self::from_files(&built_in()),
            Some(onnx) => Self::from_files(&read(onnx)?),
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
        let environment = runtime::environment()?;
        let network = Network::load(environment, &files.onnx.contents, &description)
            .map_err(|reason| DescriptorError::Model { path: files.onnx.path.clone(), reason })?;
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
        Ok(self.appearance(&panorama.views)?.components)
    }

    /// Describes what any number of pictures of one place show, and how much there is to see.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn appearance(&mut self, views: &[RgbImage]) -> Result<Appearance, DescribeError> {
        let pooled = self.pooled(views)?;
        let information = information(&pooled, self.description.information_range);
        let mut components = pooled;
        for (component, mean) in components.iter_mut().zip(&self.description.mean) {
            *component -= mean;
        }
        if let Some(projection) = &self.projection {
            components = projection.apply(&components);
        }
        make_unit(&mut components);
        Ok(Appearance { components, information })
    }

    /// The pooled features before the mean is subtracted: a unit vector without negative numbers. What mean and
    /// projection are fitted on.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn pooled(&mut self, views: &[RgbImage]) -> Result<Vec<f32>, DescribeError> {
        if views.is_empty() || views.iter().any(|view| view.width() == 0 || view.height() == 0) {
            return Err(DescribeError::Empty);
        }
        let side = self.description.view_px;
        let mut views: Vec<RgbImage> =
            views.iter().map(|view| resize(view, side, side, FilterType::Triangle)).collect();
        light::normalise(&mut views);
        let channels = usize::from(self.description.channels);
        let power = self.description.gem_power;
        let mut sums = vec![0.0_f64; channels];
        let mut count = 0_usize;
        for view in &views {
            let features = self.network.features(view)?;
            if features.channels != channels || features.values.is_empty() {
                return Err(DescribeError::Output {
                    found: format!("{} channels", features.channels),
                    expected: format!("{channels} channels"),
                });
            }
            let places = features.values.len() / channels;
            for (sum, channel) in sums.iter_mut().zip(features.values.chunks_exact(places)) {
                *sum += channel.iter().map(|&value| f64::from(value.max(1e-6)).powf(power)).sum::<f64>();
            }
            count += places;
        }
        let mut pooled: Vec<f32> = sums.iter().map(|sum| (sum / count as f64).powf(1.0 / power) as f32).collect();
        make_unit(&mut pooled);
        Ok(pooled)
    }

    /// Describes a panorama in the form that travels.
    ///
    /// # Errors
    /// [`DescribeError`].
    pub fn descriptor(&mut self, panorama: &Panorama) -> Result<Descriptor, DescribeError> {
        Ok(Descriptor::quantise(self.model.id, &self.describe(panorama)?))
    }
}

fn make_unit(vector: &mut [f32]) {
    let norm = vector.iter().map(|&value| f64::from(value) * f64::from(value)).sum::<f64>().sqrt();
    if norm > 1e-12 {
        vector.iter_mut().for_each(|value| *value = (f64::from(*value) / norm) as f32);
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
