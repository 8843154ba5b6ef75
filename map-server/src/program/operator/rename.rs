//! A map under another name: the server has everything of it go on as the new map, and deletes the
//! old one.

use crate::program::operator::asking::head;
use crate::program::operator::deletion::{self, delete, undelete};
use crate::program::operator::error::OperatorError;
use crate::program::operator::robots::fleet;
use fht_proto::MapName;
use fht_proto::api::deletion::DeletionOrder;
use fht_proto::api::reply::{ErrorCode, Head};
use serde::Serialize;
use zenoh::Session;

/// What is kept at least of the old map until the new one is seen to be whole, seconds.
const UNTIL_SEEN_S: u64 = 86_400;

/// What was renamed.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Renamed {
    /// The old map, and when it is deleted.
    old: Head,
    /// The new map.
    new: Head,
    /// Robots that run with the old name.
    still_here: Vec<String>,
}

/// Renames a map; `order` says the new name. The server does it in one commit, so that it is done
/// or not, whatever is interrupted.
pub(super) async fn rename(session: &Session, old: &MapName, order: DeletionOrder) -> Result<Renamed, OperatorError> {
    let usage = |text: String| Err(OperatorError::Usage(text));
    let Some(new) = order.moved_to.clone() else { return usage("a map is renamed to a name".to_owned()) };
    let meanwhile = DeletionOrder { grace_s: order.grace_s.max(UNTIL_SEEN_S), ..order.clone() };
    let mut last = delete(session, old, &meanwhile).await.map_err(name_is_taken)?;
    let copied = match head(session, &new).await {
        // Robots may write to it already.
        Ok(copied) if copied.vector.covers(&last.vector) => copied,
        // An older server only notes where a map has moved to; a map of that name is another one.
        Ok(_) => return Err(kept(session, old, &new).await?),
        Err(OperatorError::Refused(reply)) if reply.code == ErrorCode::UnknownMap => {
            return Err(kept(session, old, &new).await?);
        }
        Err(error) => return Err(error.of_order("maps")),
    };
    let still_here = robots_on(session, old).await;
    if order.grace_s < meanwhile.grace_s {
        last = delete(session, old, &order).await?;
    }
    Ok(Renamed { old: last, new: copied, still_here })
}

/// A name that another map has, or that the map has gone elsewhere from, is wrong input: what was
/// given would fail again.
fn name_is_taken(error: OperatorError) -> OperatorError {
    match error {
        OperatorError::Refused(reply) if reply.code == ErrorCode::Conflict => OperatorError::Usage(reply.message),
        error => error,
    }
}

/// Keeps a map that the server has not renamed: why not.
async fn kept(session: &Session, old: &MapName, new: &MapName) -> Result<OperatorError, OperatorError> {
    undelete(session, old).await?;
    let reason = OperatorError::Answer(format!("the server made no map {new}: it is too old for this program"));
    Ok(OperatorError::NotRenamed { old: old.clone(), reason: Box::new(reason) })
}

/// The robots that still use a map. A server that does not say has renamed it all the same.
async fn robots_on(session: &Session, map: &MapName) -> Vec<String> {
    let fleet = fleet(session, map).await;
    let robots = fleet.map(|fleet| fleet.robots).unwrap_or_default();
    robots.into_iter().filter(|robot| robot.alive).map(|robot| robot.status.robot).collect()
}

pub(super) fn in_words(done: &Renamed) -> String {
    let new = format!("map {} is at version {}, digest {}", done.new.map, done.new.version, done.new.digest);
    let robots = match done.still_here.as_slice() {
        [] => String::new(),
        robots => format!("\nstart again with --map {}: {}", done.new.map, robots.join(", ")),
    };
    format!("{new}\n{}{robots}", deletion::in_words(&done.old))
}
