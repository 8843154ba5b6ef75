//! Maps deleted after a grace period.

use crate::program::operator::asking::order as give_order;
use crate::program::operator::error::OperatorError;
use fht_proto::api::deletion::DeletionOrder;
use fht_proto::api::keys::{AdminAction, Key};
use fht_proto::api::reply::Head;
use fht_proto::{MapName, RobotName};
use std::time::Duration;
use zenoh::Session;

pub(super) fn order(by: &RobotName, reason: String, grace: Duration, moved_to: Option<MapName>) -> DeletionOrder {
    DeletionOrder { grace_s: grace.as_secs(), reason, by: by.clone(), moved_to }
}

/// A time such as `7d`, whole seconds, ten years at most.
pub(super) fn grace(text: &str) -> Result<Duration, String> {
    let time = humantime::parse_duration(text).map_err(|error| format!("{error}; write 12h, 7d or 0s"))?;
    let longest = Duration::from_secs(DeletionOrder::MAX_GRACE_S);
    if time > longest {
        return Err("a grace period is ten years at most".to_owned());
    }
    if !time.is_zero() && time < Duration::from_secs(1) {
        return Err("a grace period is 0s, or a second at least".to_owned());
    }
    Ok(time)
}

pub(super) fn reason(text: &str) -> Result<String, String> {
    DeletionOrder::check_reason(text).map(|()| text.to_owned()).map_err(|error| error.to_string())
}

/// Has the server delete a map; returns its head, which says so.
pub(super) async fn delete(session: &Session, map: &MapName, order: &DeletionOrder) -> Result<Head, OperatorError> {
    let payload = serde_json::to_vec(order).map_err(|error| OperatorError::json(&error))?;
    give(session, map, AdminAction::Delete, Some(payload)).await
}

/// Has the server keep a map that it was to delete.
pub(super) async fn undelete(session: &Session, map: &MapName) -> Result<Head, OperatorError> {
    give(session, map, AdminAction::Undelete, None).await
}

async fn give(
    session: &Session,
    map: &MapName,
    action: AdminAction,
    payload: Option<Vec<u8>>,
) -> Result<Head, OperatorError> {
    let key = Key::Admin { map: map.clone(), action }.to_string();
    let answer = give_order(session, &key, payload).await?;
    serde_json::from_slice(&answer).map_err(|error| OperatorError::json(&error))
}

pub(super) fn in_words(head: &Head) -> String {
    let map = &head.map;
    match &head.deletion {
        None => format!("map {map} is kept"),
        Some(deletion) if deletion.done => deletion.sentence(map),
        Some(deletion) => {
            format!("{}; until then `map-server undelete {map}` keeps it", deletion.sentence(map))
        }
    }
}
