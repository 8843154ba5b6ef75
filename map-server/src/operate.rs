//! What operators do, talking to a running server over Zenoh: look at maps, name places, draw zones, close edges, make and enable
//! releases, fold, export, import and merge.

mod command;
mod merge;
mod release;
mod robots;
mod rule;
mod transfer;
mod write;

pub use command::{Operation, OperatorArgs};

use crate::config::LinkConfig;
use crate::session::{self, SessionError};
use fht_proto::MapName;
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{ErrorReply, Head};
use serde::de::DeserializeOwned;
use std::path::PathBuf;
use std::time::Duration;
use zenoh::Session;
use zenoh::handlers::FifoChannel;

/// How long the connection may take.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);
/// How long an answer may take. Folding a large map takes its time.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

/// Why an operator's command failed.
#[derive(Debug, thiserror::Error)]
pub enum OperateError {
    /// No session.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Nobody is there.
    #[error("no server or router at {endpoints} within {} s: {reason}", CONNECT_TIMEOUT.as_secs())]
    NoRouter {
        /// Where.
        endpoints: String,
        /// What Zenoh says.
        reason: String,
    },
    /// Zenoh refused.
    #[error("Zenoh refuses: {0}")]
    Zenoh(#[from] zenoh::Error),
    /// Nobody answered in time.
    #[error("no map-server answered; is it up, and may this operator ask it? (access control drops silently)")]
    Silent,
    /// The server refused, with its reason.
    #[error("{0}")]
    Refused(ErrorReply),
    /// The answer is not what was asked for.
    #[error("the server's answer cannot be read: {0}")]
    Answer(String),
    /// What was put was not stored.
    #[error(
        "the server has not stored it within {seconds} s; may this operator write? (access control drops silently)"
    )]
    NotStored {
        /// How long was waited.
        seconds: u64,
    },
    /// The command makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not a map.
    #[error("{}: {source}", path.display())]
    Archive {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: fht_proto::archive::ArchiveError,
    },
    /// Two maps are not merged.
    #[error("not merged: {0}")]
    Merge(#[from] fht_merge::Refusal),
    /// The merge ended for no reason that it gave: a defect.
    #[error("the merge failed: {0}")]
    Lost(#[from] tokio::task::JoinError),
    /// The system gives no threads.
    #[error("no threads: {0}")]
    Runtime(std::io::Error),
}

impl OperateError {
    fn json(error: &serde_json::Error) -> Self {
        Self::Answer(error.to_string())
    }
}

/// Opens a session as a client.
async fn connect(link: &LinkConfig) -> Result<Session, OperateError> {
    let link = LinkConfig { patience: Some(CONNECT_TIMEOUT), ..link.clone() };
    session::open(&link).await.map_err(|error| match error {
        SessionError::Open { reason, .. } => {
            let file = link.zenoh_config.iter().map(|file| file.display().to_string());
            let endpoints = link.connect.iter().cloned().chain(file).collect::<Vec<_>>().join(", ");
            OperateError::NoRouter { endpoints, reason }
        }
        other => OperateError::Session(other),
    })
}

/// Asks, with a payload if there is one; the first answer counts.
async fn ask(session: &Session, selector: &str, payload: Option<Vec<u8>>) -> Result<Vec<u8>, OperateError> {
    let mut get = session.get(selector).timeout(ANSWER_TIMEOUT);
    if let Some(payload) = payload {
        get = get.payload(payload);
    }
    let replies = get.with(FifoChannel::new(16)).await?;
    let mut refusal = None;
    while let Ok(reply) = replies.recv_async().await {
        match reply.result() {
            Ok(sample) => return Ok(sample.payload().to_bytes().into_owned()),
            Err(error) => refusal = serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()).ok().or(refusal),
        }
    }
    Err(refusal.map_or(OperateError::Silent, OperateError::Refused))
}

async fn ask_json<T: DeserializeOwned>(session: &Session, selector: &str) -> Result<T, OperateError> {
    let bytes = ask(session, selector, None).await?;
    serde_json::from_slice(&bytes).map_err(|error| OperateError::json(&error))
}

async fn head(session: &Session, map: &MapName) -> Result<Head, OperateError> {
    let head: Head = ask_json(session, &Key::topic(map, Topic::Head).to_string()).await?;
    head.checked(map).map_err(|error| OperateError::Answer(error.to_string()))
}
