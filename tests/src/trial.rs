//! Why a trial on a server process ends without a result.

use crate::upload::UploadError;
use fht_client::{AskError, ReplicaError};
use fht_demo::ProcessError;
use fht_session::SessionError;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The server failed.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// The system refuses.
    #[error(transparent)]
    System(#[from] std::io::Error),
    /// No session.
    #[error(transparent)]
    Link(#[from] SessionError),
    /// No copy.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// The server does not answer.
    #[error(transparent)]
    Ask(#[from] AskError),
    /// Zenoh refuses.
    #[error("Zenoh refuses: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// The map is not on the server.
    #[error(transparent)]
    Upload(#[from] UploadError),
    /// Something did not happen in time.
    #[error("{0} in time")]
    Late(&'static str),
    /// The map has no free space.
    #[error("the map has no free space to ask for paths in")]
    NoSpace,
    /// An answer is no path.
    #[error("an answer is no path: {0}")]
    Answer(String),
    /// The clients did not report.
    #[error("the clients ended without a report")]
    NoReport,
}
