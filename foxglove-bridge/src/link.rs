//! Viewers: who may connect, what they say and are told, what they ask.
//!
//! | module | idea |
//! | --- | --- |
//! | `handshake` | from a connection to a WebSocket, for those who may |
//! | `protocol` | Foxglove's WebSocket protocol as text and bytes |
//! | `viewer` | one viewer, from its greeting to its end |
//! | `services` | what viewers ask: paths and places |

mod handshake;
mod protocol;
mod services;
mod viewer;

pub(crate) use handshake::Origins;
#[cfg(test)]
pub(crate) use services::ServiceKind;
pub(crate) use services::Services;
pub(crate) use viewer::Viewers;
