//! Maps deleted after a grace period.

use crate::program::operator::arguments::OperatorArgs;
use crate::program::operator::asking::ask;
use crate::program::operator::error::OperatorError;
use fht_proto::MapName;
use fht_proto::api::deletion::DeletionOrder;
use fht_proto::api::keys::{AdminAction, Key};
use fht_proto::api::reply::Head;
use std::time::Duration;
use zenoh::Session;

pub(super) fn order(args: &OperatorArgs, reason: String, grace: Duration, moved_to: Option<MapName>) -> DeletionOrder {
    DeletionOrder { grace_s: grace.as_secs(), reason, by: args.operator.clone(), moved_to }
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
    let answer = ask(session, &key, payload).await?;
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
