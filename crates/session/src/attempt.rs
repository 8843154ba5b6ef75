//! One attempt to open a session.

use zenoh::{Config, Session, Wait};

/// Opens a session on a thread of its own, because Zenoh's own future blocks the thread that polls
/// it.
pub(crate) async fn attempt(config: Config) -> Result<Session, zenoh::Error> {
    tokio::task::spawn_blocking(|| open(config)).await?
}

/// A function of its own, and not a closure: what an asynchronous function contains is compiled
/// again in each crate that awaits it, and Zenoh's opening takes ten seconds.
fn open(config: Config) -> Result<Session, zenoh::Error> {
    zenoh::open(config).wait()
}
