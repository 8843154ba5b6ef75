//! One attempt to open a session.

use zenoh::{Config, Session, Wait};

/// Opens a session on a thread of its own, because Zenoh's own future blocks the thread that polls
/// it.
pub(crate) async fn attempt(config: Config) -> Result<Session, zenoh::Error> {
    tokio::task::spawn_blocking(|| zenoh::open(config).wait()).await?
}
