//! Where it listens, who is let in, how much is taken.

use fht_door::{DoorCertificates, DoorError, DoorLimits};
use fht_proto::RobotName;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// How the page is served.
#[derive(Clone, Debug)]
pub struct WebConfig {
    /// Where to listen. Port 0: any that is free.
    pub address: SocketAddr,
    /// Names by which it is reached besides its address, and those in its certificate. A request to
    /// another one is refused. Default none.
    pub names: Vec<String>,
    /// Who changes maps from this machine, without a certificate. None: nobody. Default none.
    pub operator: Option<RobotName>,
    /// Certificates; none: plain HTTP, on this machine alone. Default none.
    pub tls: Option<DoorCertificates>,
    /// Where the same is asked over Zenoh, such as `tcp/0.0.0.0:7447`: the page shows how. Default
    /// none.
    pub zenoh: Option<String>,
    /// How much is taken.
    pub limits: WebLimits,
}

impl WebConfig {
    /// At an address, with defaults for everything else.
    #[must_use]
    pub fn at(address: SocketAddr) -> Self {
        Self { address, names: Vec::new(), operator: None, tls: None, zenoh: None, limits: WebLimits::default() }
    }
}

/// How much is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct WebLimits {
    /// Connections at a time. Further ones are closed at once. Default 256.
    pub connections: usize,
    /// Streams of events at a time. Further ones are told that the server is busy. Default 64.
    pub streams: usize,
    /// Longest body of a request, bytes. Default 64 KiB: a zone of 256 corners has 12 KiB.
    pub body_bytes: usize,
    /// How long a handshake, the head of a request and its body may take, each. Default 10 s.
    pub reading: Duration,
    /// How long a connection may take nothing of what it is sent. Default 20 s.
    pub writing: Duration,
    /// How long an answer may take. Default 30 s: writing a change takes 10 s at most.
    pub answering: Duration,
    /// A stream without events says so often that it is there. Default 5 s.
    pub heartbeat: Duration,
}

impl Default for WebLimits {
    fn default() -> Self {
        Self {
            connections: 256,
            streams: 64,
            body_bytes: 64 << 10,
            reading: Duration::from_secs(10),
            writing: Duration::from_secs(20),
            answering: Duration::from_secs(30),
            heartbeat: Duration::from_secs(5),
        }
    }
}

/// Why the page is not served.
#[derive(Debug, thiserror::Error)]
pub enum WebError {
    /// Without certificates everybody on the network would be let in.
    #[error(
        "--web {address}: everybody who reaches this address would be let in. Give certificates (--web-certificate, \
         --web-key, --web-authority), or an address on this machine such as 127.0.0.1:{port}", port = address.port()
    )]
    Exposed {
        /// The address.
        address: SocketAddr,
    },
    /// With certificates, these say who somebody is.
    #[error("--web-operator {name}: with certificates, these say who somebody is; leave the name out")]
    NamedTwice {
        /// The name.
        name: RobotName,
    },
    /// The address is taken, or none of this machine.
    #[error("--web {address}: cannot listen there: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file cannot be read, or has something else in it.
    #[error("--web-{option}: {} is of no use: {reason}", file.display())]
    File {
        /// Which option names it.
        option: &'static str,
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The certificate and the key do not go together, or are of a sort that is not known.
    #[error("TLS with these certificates is not possible: {0}")]
    Tls(String),
}

impl WebError {
    /// Whether what was given is wrong.
    #[must_use]
    pub fn is_input(&self) -> bool {
        !matches!(self, Self::Listen { .. })
    }
}

impl From<DoorError> for WebError {
    fn from(error: DoorError) -> Self {
        match error {
            DoorError::Exposed { address } => Self::Exposed { address },
            DoorError::Listen { address, source } => Self::Listen { address, source },
            DoorError::File { what: option, file, reason } => Self::File { option, file, reason },
            DoorError::Tls(reason) => Self::Tls(reason),
        }
    }
}

impl WebConfig {
    /// That nobody has two names.
    pub(crate) fn check(&self) -> Result<(), WebError> {
        match (&self.tls, &self.operator) {
            (Some(_), Some(name)) => Err(WebError::NamedTwice { name: name.clone() }),
            _ => Ok(()),
        }
    }
}

impl WebLimits {
    pub(crate) fn of_door(&self) -> DoorLimits {
        DoorLimits { connections: self.connections, handshake: self.reading, writing: self.writing }
    }
}
