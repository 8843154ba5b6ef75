//! Reading: from the files of a bag to sensor frames.
//!
//! | module | idea |
//! | --- | --- |
//! | `files` | which files make up a bag |
//! | `stream` | their messages, as far as they can be read |
//! | `log_order` | those that are out of order by a little, in order |
//! | `unpacking` | how much their chunks may unpack to |
//! | `survey` | what is in a bag |
//! | `topics` | which topics hold what |
//! | `frames` | all of it: [`SensorFrame`](fht_perception::frame::SensorFrame)s |
//! | `report` | what became of the messages |

pub(crate) mod files;
pub(crate) mod frames;
mod log_order;
pub(crate) mod report;
pub(crate) mod stream;
pub(crate) mod survey;
pub(crate) mod topics;
mod unpacking;
