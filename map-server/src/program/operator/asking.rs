//! An operator's session, and questions over it.

use crate::config::ServerEndpoints;
use crate::network::{self, ServerSessionError};
use crate::program::operator::error::OperatorError;
use fht_client::AskError;
use fht_program::Waiting;
use fht_proto::MapName;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{DiffReply, ErrorCode, Head, StateView};
use fht_session::{ConnectError, ListenTrouble};
use serde::de::DeserializeOwned;
use std::time::Duration;
use zenoh::Session;

/// How long an answer may take. Compacting a large map takes a while.
pub(super) const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

/// So long one question is waited for, however little patience is left.
const LEAST: Duration = Duration::from_secs(1);
/// Between two questions for what is not there yet.
const ASK_AGAIN: Duration = Duration::from_millis(200);

/// Opens a session as a client.
pub(super) async fn connect(link: &ServerEndpoints, waiting: &Waiting) -> Result<Session, OperatorError> {
    /// Longer than anybody waits.
    const FOR_EVER: Duration = Duration::from_secs(10_000_000);
    let patience = waiting.for_session().unwrap_or(FOR_EVER);
    let session = network::open(&ServerEndpoints { patience: Some(patience), ..link.clone() }).await;
    session.map_err(|error| match error {
        ServerSessionError::Link(ConnectError::Listen { listen, trouble: ListenTrouble::InUse }) => {
            OperatorError::Listens { listen }
        }
        error => error.into(),
    })
}

/// A server listens before it answers, and a map may be made later: asks until there is an answer,
/// and the map if one is needed, for as long as that is waited for. A map that is not there is left
/// to the command itself to tell. If the map will be deleted, returns the sentence that says so.
pub(super) async fn until_there(
    session: &Session,
    map: Option<&MapName>,
    waiting: &Waiting,
) -> Result<Option<String>, OperatorError> {
    let (mut answer, mut content) = (waiting.for_answer(), waiting.for_content());
    let key = map.map_or(Key::Maps, |map| Key::topic(map, Topic::Head)).to_string();
    loop {
        let timeout = answer.left().unwrap_or(ANSWER_TIMEOUT).clamp(LEAST, ANSWER_TIMEOUT);
        match fht_client::ask_until_answered(session, &key, timeout).await {
            Err(AskError::Silent) if answer.goes_on("a map-server to answer") => {}
            Err(AskError::Silent) => return Err(OperatorError::Silent),
            Err(AskError::Refused(reply))
                if reply.code == ErrorCode::UnknownMap && content.goes_on(format!("the map: {}", reply.message)) => {}
            Ok(payload) => {
                let head = map.and_then(|map| fht_client::read_head(&payload, map).ok());
                return Ok(head.and_then(|head| Some(head.deletion?.sentence(&head.map))));
            }
            Err(_) => return Ok(None),
        }
        tokio::time::sleep(ASK_AGAIN).await;
    }
}

/// Asks what does no harm when it is answered twice.
pub(super) async fn ask_binary(session: &Session, selector: &str) -> Result<Vec<u8>, OperatorError> {
    Ok(fht_client::ask_until_answered(session, selector, ANSWER_TIMEOUT).await?)
}

/// Gives an order, with a payload if there is one; the first answer counts.
pub(super) async fn order(
    session: &Session,
    selector: &str,
    payload: Option<Vec<u8>>,
) -> Result<Vec<u8>, OperatorError> {
    let answer = fht_client::ask_async(session, selector, payload, ANSWER_TIMEOUT).await;
    answer.map_err(|error| OperatorError::from(error).of_order("maps"))
}

pub(super) async fn ask_json<T: DeserializeOwned>(session: &Session, selector: &str) -> Result<T, OperatorError> {
    let bytes = fht_client::ask_until_answered(session, selector, ANSWER_TIMEOUT).await?;
    serde_json::from_slice(&bytes).map_err(|error| OperatorError::json(&error))
}

/// Gives an order to all servers; one answer of them. `see`: the command that shows what it has
/// done.
pub(super) async fn order_all_json<T: DeserializeOwned>(
    session: &Session,
    selector: &str,
    see: &str,
) -> Result<T, OperatorError> {
    let answer = fht_client::ask_all_async(session, selector, ANSWER_TIMEOUT).await;
    let bytes = answer.map_err(|error| OperatorError::from(error).of_order(see))?;
    serde_json::from_slice(&bytes).map_err(|error| OperatorError::json(&error))
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
