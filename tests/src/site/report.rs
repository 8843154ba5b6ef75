//! What a run has shown, or why it came to no result.

use fht_demo::ProcessError;
use fht_session::SessionError;
use serde::Serialize;

/// The results of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SiteReport {
    /// Increments written.
    pub written: u64,
    /// Increments acknowledged.
    pub acknowledged: u64,
    /// Acknowledged increments that a server, or the storages, lacked in the end.
    pub lost: u64,
    /// Whether all servers had the same map in the end, namely what the writers wrote.
    pub agree: bool,
    /// The same for servers that were then restarted and read everything from the storages.
    pub agree_anew: bool,
    /// Routers and servers killed.
    pub kills: u64,
    /// Questions asked.
    pub questions: u64,
    /// Questions that were not answered within the limit.
    pub late: u64,
    /// How often a question was repeated.
    pub repeated: u64,
    /// Paths that were refused because an attacker reports that the way is blocked.
    pub closed: u64,
    /// Median time to an answer, milliseconds.
    pub median_ms: f64,
    /// 99th percentile, milliseconds.
    pub p99_ms: f64,
    /// The longest time, milliseconds.
    pub greatest_ms: f64,
    /// Longest time from writing an increment to its acknowledgement, milliseconds.
    pub greatest_acknowledgement_ms: f64,
    /// Bytes put by writers, divided by the bytes of their increments.
    pub repetition: f64,
}

impl SiteReport {
    /// Whether everything is as it must be.
    #[must_use]
    pub fn is_success(&self) -> bool {
        self.lost == 0 && self.late == 0 && self.agree && self.agree_anew && self.acknowledged == self.written
    }
}

/// Why a run came to no result.
#[derive(Debug, thiserror::Error)]
pub enum SiteError {
    /// A process failed.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// A session cannot be opened.
    #[error(transparent)]
    Link(#[from] SessionError),
    /// Zenoh refused.
    #[error("Zenoh refuses: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// A file or a port.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Publishing ended with an error.
    #[error("a writer failed: {0}")]
    Publish(#[from] mapper::publish::PublishError),
    /// A robot's thread panicked.
    #[error("a robot's thread failed: {0}")]
    Thread(#[from] tokio::task::JoinError),
    /// The site does not come up.
    #[error("{0}")]
    Late(String),
}
