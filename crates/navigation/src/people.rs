//! People and whatever else walks or drives about: which returns of a scan are theirs, where they
//! are, and how a robot drives among them.
//!
//! Nothing here knows what a person looks like. What is now where beams passed a moment ago moves;
//! what moved is remembered while it stands.
//!
//! | module | idea |
//! | --- | --- |
//! | `moving_returns` | the returns of a scan that something moving gave |
//! | `bystanders` | who is about, walking or standing |
//! | `distance` | commands that keep a distance from them |

mod bystanders;
mod distance;
mod moving_returns;

pub use bystanders::{Bystander, BystanderConfig, Bystanders};
pub use distance::{DistanceConfig, keep_distance};
pub use moving_returns::MovingReturnConfig;
