//! Who may connect to a program, and how much of it one connection may take. What is spoken inside
//! is for others: the operators' page speaks HTTP, the bridge to Foxglove WebSocket.
//!
//! ```text
//! socket ─→ room for so many ─→ TLS, certificates ─→ Caller, DoorStream ─→ whoever answers
//! ```
//!
//! | module | idea |
//! | --- | --- |
//! | `door` | a socket that is bound, and connections taken from it: a [`Door`] |
//! | `tls` | certificates of this side, and of those who come |
//! | `caller` | who is on the other end |
//! | `hosts` | the names by which this side is reached |
//! | `patient_io` | a connection that is given up when it takes nothing any more |
//! | `error` | why nobody is let in |
//!
//! Who listens beyond this machine needs certificates:
//!
//! ```
//! use fht_door::{Door, DoorError, DoorLimits};
//! use std::time::Duration;
//!
//! let patience = Duration::from_secs(10);
//! let limits = DoorLimits { connections: 16, handshake: patience, writing: patience };
//! let exposed = Door::bind("0.0.0.0:0".parse()?, None, &[], limits.clone());
//! assert!(matches!(exposed, Err(DoorError::Exposed { .. })));
//!
//! let here = Door::bind("127.0.0.1:0".parse()?, None, &[], limits)?;
//! assert!(here.hosts().has("localhost:8765") && !here.hosts().has("evil.example"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod caller;
mod door;
mod error;
mod hosts;
mod patient_io;
mod tls;

pub use caller::{Caller, MemberRole};
pub use door::{Door, DoorCounts, DoorLimits, DoorStream, Duplex};
pub use error::DoorError;
pub use hosts::Hosts;
pub use patient_io::PatientIo;
pub use tls::DoorCertificates;
