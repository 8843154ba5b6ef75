//! What operators do, talking to a running server over Zenoh: look at maps, name places, draw
//! zones, close edges, make and enable releases, compact, export, import and merge.
//!
//! | module | idea |
//! | --- | --- |
//! | `command` | the subcommands |
//! | `words` | replies as text |
//! | `asking` | the operator's session, and questions over it |
//! | `write` | the operator's increments |
//! | `release` | releases |
//! | `rule` | named places, zones, closed edges |
//! | `robots` | the table of robots |
//! | `transfer` | maps to files and back |
//! | `merge` | two maps become one |
//! | `error` | why a command failed |

mod asking;
mod command;
mod error;
mod merge;
mod release;
mod robots;
mod rule;
mod transfer;
mod words;
mod write;

pub(super) use command::{Operation, OperatorArgs};
pub(super) use error::OperatorError;
