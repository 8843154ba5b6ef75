//! Why a model cannot be loaded, and why a panorama cannot be described.

use crate::description::DescriptionError;
use crate::projection::ProjectionError;
use crate::runtime::RuntimeError;
use std::path::PathBuf;

/// Why a model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DescriptorError {
    /// A file cannot be read.
    #[error("{path} cannot be read: {source}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
    },
    /// The network is not the one that its description names.
    #[error(
        "{path} was altered: its BLAKE3 hash is {found}, and its description says {expected}",
        path = path.display()
    )]
    Altered {
        /// The ONNX file.
        path: PathBuf,
        /// Its hash.
        found: String,
        /// The description's.
        expected: String,
    },
    /// The description is not valid.
    #[error("{path}: {source}", path = path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: DescriptionError,
    },
    /// The projection does not fit the description.
    #[error("{path}: {source}", path = path.display())]
    Projection {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: ProjectionError,
    },
    /// The ONNX Runtime library was not found.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// The runtime rejects the model.
    #[error("{path} cannot be loaded as an ONNX model: {reason}", path = path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// The runtime's message.
        reason: String,
    },
}

/// Why a panorama cannot be described.
#[derive(Debug, thiserror::Error)]
pub enum DescribeError {
    /// There is no view, or a view has no pixels.
    #[error("there is no picture to describe")]
    Empty,
    /// The network failed.
    #[error("the network failed: {0}")]
    Network(String),
    /// The network's output differs from its description.
    #[error("the network gave {found}, its description says {expected}")]
    Output {
        /// The shape found.
        found: String,
        /// The shape expected.
        expected: String,
    },
}
