//! Why a server ends.

use crate::network::ServerSessionError;
use crate::store::StoreError;

/// Why a server ends that was not told to.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The log cannot be opened, read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The network cannot be used.
    #[error(transparent)]
    Session(#[from] ServerSessionError),
    /// A subscription was refused.
    #[error("Zenoh refuses: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// The system gives no threads.
    #[error("no threads: {0}")]
    Runtime(std::io::Error),
    /// The page cannot be served.
    #[cfg(feature = "web")]
    #[error(transparent)]
    Web(#[from] fht_web::WebError),
    /// The writer has ended without giving a reason.
    #[error("the writer has stopped")]
    WriterLost,
}

impl ServerError {
    /// Whether what was given is wrong.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Session(error) => error.is_input(),
            #[cfg(feature = "web")]
            Self::Web(error) => error.is_input(),
            _ => false,
        }
    }
}
