//! Why something on the graph cannot be done.

use crate::names::NameError;
use fht_ros_messages::cdr::CdrError;

/// Why an endpoint cannot be made or used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RosError {
    /// The name cannot be one.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The type has no hash, since it is not defined in `fht-ros-messages`.
    #[error("the type {0} is not defined here, so it has no hash")]
    Type(String),
    /// A message cannot be written or read.
    #[error("the message of {name} is not one of its type: {reason}")]
    Message {
        /// The topic or service.
        name: String,
        /// What is wrong.
        #[source]
        reason: CdrError,
    },
    /// Zenoh does not do it.
    #[error("Zenoh does not {what}: {reason}")]
    Zenoh {
        /// What was to be done.
        what: String,
        /// Zenoh's words.
        reason: String,
    },
    /// The system gives no thread.
    #[error("a thread cannot be started: {0}")]
    Thread(#[source] std::io::Error),
    /// Nobody serves the service or action.
    #[error("nobody answers {0}: does its node run, in the same domain, with the same distribution?")]
    NoServer(String),
    /// The server says no, in its own words.
    #[error("{name} refuses: {reason}")]
    Refused {
        /// The service or action.
        name: String,
        /// The server's words.
        reason: String,
    },
}

impl RosError {
    /// Zenoh's error, with what was to be done.
    pub(crate) fn zenoh(what: impl Into<String>) -> impl FnOnce(zenoh::Error) -> Self {
        let what = what.into();
        move |error| Self::Zenoh { what, reason: fht_session::in_words(&error) }
    }

    pub(crate) fn message(name: &str) -> impl FnOnce(CdrError) -> Self {
        move |reason| Self::Message { name: name.to_owned(), reason }
    }
}
