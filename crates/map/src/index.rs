//! Finding nodes by place and by appearance.
//!
//! | module | idea |
//! | --- | --- |
//! | `map_index` | everything that finds things in one map, kept up with it |
//! | `spatial` | nodes by where they and their rectangles are |
//! | [`descriptors`] | main nodes by what they look like |
//! | [`lookup`] | the answers: nodes near a place, nodes that look alike |

pub mod descriptors;
pub mod lookup;
pub(crate) mod map_index;
pub(crate) mod spatial;
