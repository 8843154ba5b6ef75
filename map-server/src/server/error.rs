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
    /// The writer has ended without giving a reason.
    #[error("the writer has stopped")]
    WriterLost,
}
