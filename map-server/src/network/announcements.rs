//! Publishes heads, and refusals to the writers that they concern.

use crate::ingest::RefusalNotice;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::Head;
use serde::Serialize;
use zenoh::bytes::Encoding;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::{Session, Wait};

/// Publishes a head. A lost one does no harm: writers ask when they hear nothing.
pub(crate) fn publish_head(session: &Session, head: &Head) {
    if let Err(error) = put_json(session, &Key::topic(&head.map, Topic::Head), head, Urgency::Express) {
        tracing::warn!(map = %head.map, "the head could not be published: {error}");
    }
}

/// Tells a writer why its increment was refused. A lost refusal does no harm: the writer sends the
/// increment again and is refused again.
pub(crate) fn publish_refusal(session: &Session, notice: &RefusalNotice) {
    let key = Key::refused(&notice.map, notice.author);
    if let Err(error) = put_json(session, &key, &notice.reply, Urgency::Usual) {
        tracing::warn!(map = %notice.map, author = %notice.author, "a refusal could not be published: {error}");
    }
}

enum Urgency {
    Usual,
    /// Before other messages, and not batched with them.
    Express,
}

fn put_json<T: Serialize>(session: &Session, key: &Key, value: &T, urgency: Urgency) -> Result<(), zenoh::Error> {
    let put = session
        .put(key.to_string(), serde_json::to_vec(value)?)
        .encoding(Encoding::APPLICATION_JSON)
        .congestion_control(CongestionControl::Drop);
    match urgency {
        Urgency::Usual => put.wait(),
        Urgency::Express => put.priority(Priority::InteractiveHigh).express(true).wait(),
    }
}
