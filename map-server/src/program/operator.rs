//! What operators do, talking to a running server over Zenoh: look at maps, name places, draw
//! zones, close edges, make and enable releases, compact, export, import and merge.
//!
//! | module | idea |
//! | --- | --- |
//! | `arguments` | the subcommands, as they are written |
//! | `command` | … and carried out |
//! | `words` | replies as text |
//! | `asking` | the operator's session, and questions over it |
//! | `write` | the operator's increments |
//! | `release` | releases |
//! | `blocked` | what robots report blocked |
//! | `quota` | what writers take of the server's room |
//! | `rule` | named places, zones, closed edges |
//! | `siting` | where a map lies: against a floor plan, and on earth |
//! | `deletion` | maps deleted after a grace period |
//! | `rename` | a map under another name |
//! | `undo` | an operator's last changes taken back |
//! | `journal` | what operators have changed |
//! | `robots` | the table of robots |
//! | `send` | robots are sent somewhere |
//! | `transfer` | maps to files and back |
//! | `merge` | two maps become one |
//! | `error` | why a command failed |

mod arguments;
mod asking;
mod blocked;
mod command;
mod deletion;
mod error;
mod journal;
mod merge;
mod quota;
mod release;
mod rename;
mod robots;
mod rule;
mod send;
mod siting;
mod transfer;
mod undo;
mod words;
mod write;

pub(super) use arguments::{Operation, OperatorArgs};
pub(super) use error::OperatorError;
