//! ROS 2 messages: their fields, their serialization, and what they mean to a robot on a plane.
//!
//! | module | idea |
//! | --- | --- |
//! | [`msg`] | the messages, field for field |
//! | [`cdr`] | their serialization |
//! | `definitions` | their definitions as text, which MCAP files carry |
//! | `yaw` | headings as quaternions and back |
//! | `plane` | poses on the plane, and times, as messages |
//! | `scan` | laser scans as the robot's own and back |
//! | `tf` | the tree of coordinate frames, and how the scanner is mounted |

pub mod cdr;
pub(crate) mod definitions;
pub mod msg;
pub(crate) mod plane;
pub(crate) mod scan;
pub(crate) mod tf;
pub(crate) mod yaw;
