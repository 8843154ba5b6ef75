//! A map under another name: everything of it goes to a new map, and the old one is deleted.

use crate::program::operator::asking::{ask_json, head};
use crate::program::operator::deletion::{self, delete};
use crate::program::operator::error::OperatorError;
use crate::program::operator::transfer::{fetch_whole, pieces, progress, put_series};
use fht_proto::MapName;
use fht_proto::api::deletion::DeletionOrder;
use fht_proto::api::keys::Key;
use fht_proto::api::reply::{Head, MapsReply};
use serde::Serialize;
use zenoh::Session;

/// What is kept at least of the old map until the new one is whole, seconds.
const COPYING_S: u64 = 86_400;

/// What was renamed.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Renamed {
    /// The old map, and when it is deleted.
    old: Head,
    /// The new map.
    new: Head,
}

/// Renames a map; `order` says the new name. Nobody writes to the old map from its beginning on,
/// so nothing comes too late; if it is interrupted, it goes on when it is called again.
pub(super) async fn rename(
    session: &Session,
    old: &MapName,
    order: DeletionOrder,
    quiet: bool,
) -> Result<Renamed, OperatorError> {
    let usage = |text: String| Err(OperatorError::Usage(text));
    let Some(new) = order.moved_to.clone() else { return usage("a map is renamed to a name".to_owned()) };
    if *old == new {
        return usage(format!("{old} is its name already"));
    }
    let before = head(session, old).await?;
    let has_begun = before.deletion.as_ref().is_some_and(|deletion| deletion.moved_to.as_ref() == Some(&new));
    let moved = before.deletion.as_ref().and_then(|deletion| deletion.moved_to.as_ref());
    if let Some(elsewhere) = moved.filter(|elsewhere| **elsewhere != new) {
        let text = format!(
            "{old} has moved to {elsewhere} already: rename {elsewhere}, or keep {old} with \
             `map-server undelete {old}` first"
        );
        return usage(text);
    }
    let maps: MapsReply = ask_json(session, &Key::Maps.to_string()).await?;
    if !has_begun && maps.maps.iter().any(|head| head.map == new) {
        return usage(format!("there is a map {new} already: choose another name, or merge them"));
    }
    let meanwhile = DeletionOrder { grace_s: order.grace_s.max(COPYING_S), ..order.clone() };
    let mut last = delete(session, old, &meanwhile).await?;
    let copied = copy(session, &last, &new, quiet).await;
    let copied = match copied {
        Ok(copied) => copied,
        Err(reason) => return Err(not_renamed(session, (old, &new), has_begun, reason).await),
    };
    if order.grace_s < meanwhile.grace_s {
        last = delete(session, old, &order).await?;
    }
    Ok(Renamed { old: last, new: copied })
}

/// Why a map is not renamed. A new map that the server refuses will not be whole the next time
/// either, so the old one is kept as it was.
async fn not_renamed(
    session: &Session,
    (old, new): (&MapName, &MapName),
    had_begun: bool,
    reason: OperatorError,
) -> OperatorError {
    let (old, new, is_refused) = (old.clone(), new.clone(), matches!(reason, OperatorError::Refused(_)));
    let reason = Box::new(reason);
    if is_refused && !had_begun && deletion::undelete(session, &old).await.is_ok() {
        OperatorError::KeptAsItWas { old, new, reason }
    } else {
        OperatorError::NotRenamed { old, reason }
    }
}

/// Copies all of a map; returns the new map's head.
async fn copy(session: &Session, old: &Head, new: &MapName, quiet: bool) -> Result<Head, OperatorError> {
    let bar = progress(old.vector.version(), "increments", quiet);
    bar.set_prefix(new.to_string());
    let whole = fetch_whole(session, &old.map, &old.vector, &bar).await?;
    for piece in pieces(whole) {
        put_series(session, new, &piece).await?;
    }
    bar.finish_and_clear();
    let copied = head(session, new).await?;
    if (&copied.vector, copied.digest) != (&old.vector, old.digest) {
        let text = format!("map {new} is not what {} is: digest {} instead of {}", old.map, copied.digest, old.digest);
        return Err(OperatorError::Answer(text));
    }
    Ok(copied)
}

pub(super) fn in_words(done: &Renamed) -> String {
    let new = format!("map {} is at version {}, digest {}", done.new.map, done.new.version, done.new.digest);
    format!("{new}\n{}", deletion::in_words(&done.old))
}
