//! Following a path with a differential drive, and not hitting what the scan shows.
//!
//! The follower is a regulated pure pursuit: it steers along an arc to a point ahead on the path,
//! slower where the path bends and near its end, and turns on the spot when it looks the wrong way.
//! The safety check knows nothing of paths or maps: it only compares a command with the newest
//! scan.

mod path_follower;
mod safety;
mod speed_limit;

pub use path_follower::{PathFollower, PathFollowerConfig, distance_to_segment};
pub(crate) use safety::position_after;
pub use safety::{SafetyConfig, safe_command};
pub use speed_limit::speed_limit_ahead;
