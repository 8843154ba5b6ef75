//! A map under another name: the server has everything of it go on as the new map, and deletes the
//! old one.

use crate::program::operator::asking::head;
use crate::program::operator::deletion::{self, delete, undelete};
use crate::program::operator::error::OperatorError;
use fht_proto::MapName;
use fht_proto::api::deletion::DeletionOrder;
use fht_proto::api::reply::Head;
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
}

/// Renames a map; `order` says the new name. The server does it in one commit, so that it is done
/// or not, whatever is interrupted.
pub(super) async fn rename(session: &Session, old: &MapName, order: DeletionOrder) -> Result<Renamed, OperatorError> {
    let usage = |text: String| Err(OperatorError::Usage(text));
    let Some(new) = order.moved_to.clone() else { return usage("a map is renamed to a name".to_owned()) };
    let meanwhile = DeletionOrder { grace_s: order.grace_s.max(UNTIL_SEEN_S), ..order.clone() };
    let mut last = delete(session, old, &meanwhile).await?;
    let copied = match head(session, &new).await {
        Ok(copied) if (&copied.vector, copied.digest) == (&last.vector, last.digest) => copied,
        // An older server only notes where a map has moved to.
        Err(OperatorError::Refused(_)) => {
            undelete(session, old).await?;
            let reason = OperatorError::Answer(format!("the server made no map {new}: it is too old for this program"));
            return Err(OperatorError::NotRenamed { old: old.clone(), reason: Box::new(reason) });
        }
        // Robots write to it already.
        Ok(copied) => copied,
        Err(error) => return Err(error),
    };
    if order.grace_s < meanwhile.grace_s {
        last = delete(session, old, &order).await?;
    }
    Ok(Renamed { old: last, new: copied })
}

pub(super) fn in_words(done: &Renamed) -> String {
    let new = format!("map {} is at version {}, digest {}", done.new.map, done.new.version, done.new.digest);
    format!("{new}\n{}", deletion::in_words(&done.old))
}
