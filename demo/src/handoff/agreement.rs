//! Whether copies of a map are the server's. Others may write meanwhile, an operator for one, so
//! each copy is held against the state of the server that has the same increments.

use fht_client::{AskError, ask};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::DiffReply;
use fht_proto::{Digest, MapName, VersionVector};
use std::time::{Duration, Instant};
use zenoh::Session;

/// Between two questions for increments that are on their way to the server.
const ASK_AGAIN: Duration = Duration::from_millis(200);

/// Whether the server's map with the increments of `vector` has this digest; it may take
/// `patience` until the server has them all.
pub(super) fn is_servers(
    session: &Session,
    map: &MapName,
    vector: &VersionVector,
    digest: Digest,
    patience: Duration,
) -> Result<bool, AskError> {
    let selector = format!("{}?from={vector};to={vector}", Key::topic(map, Topic::Diff));
    let deadline = Instant::now() + patience;
    loop {
        match ask(session, &selector, patience) {
            Ok(answers) => {
                let answer = answers.last().ok_or(AskError::Silent)?;
                let reply: DiffReply =
                    serde_json::from_slice(answer).map_err(|error| AskError::Unreadable(error.to_string()))?;
                return Ok(reply.from.digest == digest);
            }
            // Perhaps it has not heard of them yet.
            Err(AskError::Refused(_)) if Instant::now() < deadline => std::thread::sleep(ASK_AGAIN),
            Err(AskError::Refused(_)) => return Ok(false),
            Err(error) => return Err(error),
        }
    }
}
