//! Writing: from sensor frames to a bag.
//!
//! | module | idea |
//! | --- | --- |
//! | `recording` | frames as messages |
//! | `writer` | messages as a bag |
//! | `map` | what a robot knows of its map, as messages |
//! | `metadata` | what rosbag2 wants to know about a bag |
//! | `recorder` | a bag that a thread of its own writes |

pub(crate) mod map;
pub(crate) mod metadata;
pub(crate) mod recorder;
pub(crate) mod recording;
pub(crate) mod writer;
