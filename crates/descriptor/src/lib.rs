//! The visual descriptor φ: a CNN over the panorama, pooled into a unit vector that does not
//! depend on the robot's heading.
//!
//! ```text
//!  Panorama ─→ cylinder ─→ light ─→ network ─→ pool ─→ projection ─→ unit vector φ
//!  4 views     one strip   one      ONNX       GeM     mean and      I(φ): information
//!                          mapping                     matrix
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `describe` | [`DescriptorNet`]: a network with its description, from panorama to descriptor |
//! | `description` | what a model needs beside its ONNX file |
//! | `files` | the files of a model: built in, or in a folder |
//! | `cylinder` | the panorama as a strip without a seam |
//! | `light` | the same place in another light gives nearly the same pixels |
//! | `network` | one network, in ONNX Runtime or (feature `tract`) in pure Rust |
//! | `pool` | generalised-mean pooling |
//! | `projection` | what tells places apart |
//! | `information` | how much there is to see |
//! | `runtime` | finding the ONNX Runtime library without the user's help, and checking it |
//!
//! The panorama is unrolled to a strip that goes around, so there is no seam, and a turn of the
//! robot is a shift of the strip. The network's output is pooled over the whole strip (GeM:
//! Radenović et al., TPAMI 2018) and scaled to a unit vector. A mean that all places share is
//! subtracted, the rest is projected on what tells places apart, and the result is scaled to a unit
//! vector again. A model with a fixed input size gets the four views one by one instead, pooled
//! together.
//!
//! ```
//! use fht_descriptor::{DescribeError, DescriptorNet};
//! use fht_perception::frame::Panorama;
//!
//! /// Whether two panoramas are of one place.
//! fn are_one_place(
//!     net: &mut DescriptorNet,
//!     here: &Panorama,
//!     there: &Panorama,
//! ) -> Result<bool, DescribeError> {
//!     let (here, there) = (net.appearance(here)?, net.appearance(there)?);
//!     let cosine: f32 = here.components.iter().zip(&there.components).map(|(a, b)| a * b).sum();
//!     Ok(cosine >= f32::from(net.model().match_threshold_e3) / 1000.0)
//! }
//! ```

mod cylinder;
mod describe;
mod description;
mod error;
mod files;
mod information;
mod light;
mod network;
mod pool;
mod projection;
// With tract nothing looks for a library; the error stays part of the interface.
#[cfg_attr(feature = "tract", allow(dead_code))]
mod runtime;

pub use describe::{Appearance, DescriptorNet};
pub use description::{Description, DescriptionError, InputLayout};
pub use error::{DescribeError, DescriptorError};
pub use projection::ProjectionError;
pub use runtime::{Fetching, RuntimeError};

#[cfg(test)]
mod tests;
