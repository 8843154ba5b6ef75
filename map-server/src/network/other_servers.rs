//! Notices another server that answers for the same maps.

use crate::network::robot_topics::LEARN_WITHIN;
use fht_proto::api::keys::Key;
use zenoh::Session;
use zenoh::query::{ConsolidationMode, QueryTarget};
use zenoh::sample::Locality;

/// Warns if another server answers within this server's reach. Two that keep logs of their own hold
/// maps that differ, and a robot is answered by either.
pub(crate) async fn warn_of_other_servers(session: Session) {
    let asked = session
        .get(Key::Maps.to_string())
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .allowed_destination(Locality::Remote)
        .timeout(LEARN_WITHIN)
        .await;
    let Ok(replies) = asked else { return };
    while let Ok(reply) = replies.recv_async().await {
        if reply.result().is_ok() {
            tracing::warn!(
                "another map-server answers here, and this one keeps a log of its own: their maps will differ, and \
                 robots are answered by either. End one of them, or let both stand on storages (--storages)"
            );
            return;
        }
    }
}
