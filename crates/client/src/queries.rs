//! Questions to the map server.

use fht_proto::MapName;
use fht_proto::api::fleet::FleetReply;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorReply, Head};
use serde::de::DeserializeOwned;
use std::time::{Duration, Instant};
use zenoh::handlers::FifoChannel;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::{Session, Wait};

/// Why a question has no answer.
#[derive(Debug, thiserror::Error)]
pub enum AskError {
    /// Zenoh refused.
    #[error("the question cannot be put: {}", fht_session::in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// Nobody answered in time.
    #[error("no map-server answered")]
    Silent,
    /// The server refused, with its reason.
    #[error("{0}")]
    Refused(ErrorReply),
    /// The answer cannot be read.
    #[error("the answer cannot be read: {0}")]
    Unreadable(String),
}

/// Puts a question and returns the payloads of all answers. An error reply is the outcome if
/// nothing else came.
///
/// # Errors
/// Why there is no answer.
pub fn ask(session: &Session, selector: &str, timeout: Duration) -> Result<Vec<Vec<u8>>, AskError> {
    let replies = session.get(selector).timeout(timeout).with(FifoChannel::new(256)).wait()?;
    let mut payloads = Vec::new();
    let mut refusal = None;
    while let Ok(reply) = replies.recv() {
        match reply.result() {
            Ok(sample) => payloads.push(sample.payload().to_bytes().into_owned()),
            Err(error) => refusal = serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()).ok().or(refusal),
        }
    }
    match (payloads.is_empty(), refusal) {
        (true, Some(refusal)) => Err(AskError::Refused(refusal)),
        (true, None) => Err(AskError::Silent),
        (false, _) => Ok(payloads),
    }
}

/// Puts a question without blocking, with a payload if there is one; the first answer counts, or
/// else the refusal.
///
/// # Errors
/// Why there is no answer.
pub async fn ask_async(
    session: &Session,
    selector: &str,
    payload: Option<Vec<u8>>,
    timeout: Duration,
) -> Result<Vec<u8>, AskError> {
    let mut get = session.get(selector).timeout(timeout);
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
    Err(refusal.map_or(AskError::Silent, AskError::Refused))
}

/// Puts a question without blocking, again and again until there is an answer or `timeout` is over:
/// routers drop what a link cannot take at that moment, and nobody says so. The question must do no
/// harm when it is answered twice.
///
/// # Errors
/// Why there is no answer.
pub async fn ask_until_answered(session: &Session, selector: &str, timeout: Duration) -> Result<Vec<u8>, AskError> {
    /// How long the first answer may take; each later one twice as long.
    const FIRST: Duration = Duration::from_secs(3);
    let (begin, mut patience) = (Instant::now(), FIRST);
    loop {
        let (asked, left) = (Instant::now(), timeout.saturating_sub(begin.elapsed()));
        let answer = ask_async(session, selector, None, patience.min(left)).await;
        // Silence that comes early says that nobody is there.
        let is_lost = matches!(answer, Err(AskError::Silent)) && asked.elapsed() >= patience;
        if !is_lost || begin.elapsed() >= timeout {
            return answer;
        }
        patience *= 2;
    }
}

/// Puts a question to all servers without blocking; waits for all, and returns an answer, or else a
/// refusal.
///
/// # Errors
/// Why there is no answer.
pub async fn ask_all_async(session: &Session, selector: &str, timeout: Duration) -> Result<Vec<u8>, AskError> {
    let get = session.get(selector).timeout(timeout).target(QueryTarget::All).consolidation(ConsolidationMode::None);
    let replies = get.with(FifoChannel::new(16)).await?;
    let (mut answer, mut refusal) = (None, None);
    while let Ok(reply) = replies.recv_async().await {
        match reply.result() {
            Ok(sample) => answer = Some(sample.payload().to_bytes().into_owned()),
            Err(error) => refusal = serde_json::from_slice::<ErrorReply>(&error.payload().to_bytes()).ok().or(refusal),
        }
    }
    answer.ok_or_else(|| refusal.map_or(AskError::Silent, AskError::Refused))
}

/// Puts a question without blocking, and reads the first answer as JSON.
///
/// # Errors
/// Why there is no answer.
pub async fn ask_json_async<T: DeserializeOwned>(
    session: &Session,
    selector: &str,
    timeout: Duration,
) -> Result<T, AskError> {
    let bytes = ask_async(session, selector, None, timeout).await?;
    serde_json::from_slice(&bytes).map_err(|error| AskError::Unreadable(error.to_string()))
}

/// Asks the server for the robots on a map without blocking: all of them, page by page.
///
/// # Errors
/// Why there is no answer.
pub async fn ask_fleet_async(session: &Session, map: &MapName, timeout: Duration) -> Result<FleetReply, AskError> {
    let key = Key::topic(map, Topic::Fleet);
    let mut fleet: FleetReply = ask_json_async(session, &key.to_string(), timeout).await?;
    while let Some(after) = fleet.next.take() {
        let page: FleetReply = ask_json_async(session, &format!("{key}?after={after}"), timeout).await?;
        // Names ascend, or it would not end.
        if page.next.as_ref().is_some_and(|next| *next <= after) {
            return Err(AskError::Unreadable(format!("robots after {after} lead back")));
        }
        fleet.robots.extend(page.robots);
        fleet.next = page.next;
    }
    fleet.truncated = false;
    Ok(fleet)
}

/// Asks the server for a map's head without blocking.
///
/// # Errors
/// Why there is no answer.
pub async fn ask_head_async(session: &Session, map: &MapName, timeout: Duration) -> Result<Head, AskError> {
    let payload = ask_until_answered(session, &Key::topic(map, Topic::Head).to_string(), timeout).await?;
    read_head(&payload, map)
}

/// Reads the JSON form of a head of `map`.
///
/// # Errors
/// [`AskError::Unreadable`].
pub fn read_head(payload: &[u8], map: &MapName) -> Result<Head, AskError> {
    let head: Head = serde_json::from_slice(payload).map_err(|error| AskError::Unreadable(error.to_string()))?;
    head.checked(map).map_err(|error| AskError::Unreadable(error.to_string()))
}

/// Asks the server for a map's head.
///
/// # Errors
/// The server's reason, or a sentence if it did not answer.
pub fn ask_head(session: &Session, map: &MapName, timeout: Duration) -> Result<Head, AskError> {
    let replies = ask(session, &Key::topic(map, Topic::Head).to_string(), timeout)?;
    let first = replies.into_iter().next().ok_or(AskError::Silent)?;
    read_head(&first, map)
}
