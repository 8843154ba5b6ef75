//! An operator's session, and questions over it.

use crate::config::ServerEndpoints;
use crate::network::{self, ServerSessionError};
use crate::program::operator::error::{CONNECT_TIMEOUT, OperatorError};
use fht_proto::MapName;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{DiffReply, Head, StateView};
use serde::de::DeserializeOwned;
use std::time::Duration;
use zenoh::Session;

/// How long an answer may take. Compacting a large map takes a while.
pub(super) const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

/// Opens a session as a client.
pub(super) async fn connect(link: &ServerEndpoints) -> Result<Session, OperatorError> {
    let link = ServerEndpoints { patience: Some(CONNECT_TIMEOUT), ..link.clone() };
    network::open(&link).await.map_err(|error| match error {
        ServerSessionError::Open { reason, .. } => {
            let file = link.zenoh_config.iter().map(|file| file.display().to_string());
            let endpoints = link.connect.iter().cloned().chain(file).collect::<Vec<_>>().join(", ");
            OperatorError::NoRouter { endpoints, reason }
        }
        other => OperatorError::Session(other),
    })
}

/// Asks, with a payload if there is one; the first answer counts.
pub(super) async fn ask(session: &Session, selector: &str, payload: Option<Vec<u8>>) -> Result<Vec<u8>, OperatorError> {
    Ok(fht_client::ask_async(session, selector, payload, ANSWER_TIMEOUT).await?)
}

pub(super) async fn ask_json<T: DeserializeOwned>(session: &Session, selector: &str) -> Result<T, OperatorError> {
    Ok(fht_client::ask_json_async(session, selector, ANSWER_TIMEOUT).await?)
}

pub(super) async fn head(session: &Session, map: &MapName) -> Result<Head, OperatorError> {
    Ok(fht_client::ask_head_async(session, map, ANSWER_TIMEOUT).await?)
}

/// The vector and digest of a state of a map: a release or a version, or the newest state if
/// `state` is none.
pub(super) async fn state_of(
    session: &Session,
    map: &MapName,
    state: Option<&str>,
) -> Result<StateView, OperatorError> {
    match state {
        None => {
            let Head { version, vector, digest, .. } = head(session, map).await?;
            Ok(StateView { version, vector, digest })
        }
        Some(state) => {
            let selector = format!("{}?from={state};to={state}", Key::topic(map, Topic::Diff));
            Ok(ask_json::<DiffReply>(session, &selector).await?.to)
        }
    }
}
