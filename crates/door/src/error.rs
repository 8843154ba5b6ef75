//! Why nobody is let in.

use std::net::SocketAddr;
use std::path::PathBuf;

/// Why nobody is let in. Programs say it with the names of their flags.
#[derive(Debug, thiserror::Error)]
pub enum DoorError {
    /// Without certificates everybody on the network would be let in.
    #[error("{address}: everybody who reaches this address would be let in")]
    Exposed {
        /// The address.
        address: SocketAddr,
    },
    /// The address is taken, or none of this machine.
    #[error("{address}: cannot listen there: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file cannot be read, or has something else in it.
    #[error("the {what} {} is of no use: {reason}", file.display())]
    File {
        /// Which one: `certificate`, `key` or `authority`.
        what: &'static str,
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The certificate and the key do not go together, or are of a sort that is not known.
    #[error("TLS with these certificates is not possible: {0}")]
    Tls(String),
}

impl DoorError {
    /// Whether what was given is wrong.
    #[must_use]
    pub fn is_input(&self) -> bool {
        !matches!(self, Self::Listen { .. })
    }
}
