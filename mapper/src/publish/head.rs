//! What the server has, asked of it.

use super::PublishError;
use fht_client::{AskError, ask_head_async};
use fht_proto::MapName;
use fht_proto::api::reply::{ErrorCode, Head};
use std::time::{Duration, Instant};

/// What is known of a server that does not answer.
const SILENCE: &str = "nobody answered: is a map-server up, and may this robot ask it? (access control drops silently)";
/// How long the server has for one answer.
pub(super) const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);
/// So often it is said what is waited for.
const REMARK_EVERY: Duration = Duration::from_secs(5);
/// Pause before a question is put again.
pub(crate) const ASK_AGAIN: Duration = Duration::from_millis(200);

/// What came back to the question for a head.
pub(super) enum Answer {
    Head(Box<Head>),
    /// The server has no such map.
    NoMap,
    /// No server answered (`is_silent`), or not to the question: what came instead.
    None {
        reason: String,
        is_silent: bool,
    },
}

pub(super) async fn ask_head(session: &zenoh::Session, map: &MapName) -> Result<Answer, PublishError> {
    let other = |reason: String| Answer::None { reason, is_silent: false };
    Ok(match ask_head_async(session, map, ANSWER_TIMEOUT).await {
        Ok(head) => Answer::Head(Box::new(head)),
        Err(AskError::Refused(reply)) if reply.code == ErrorCode::UnknownMap => Answer::NoMap,
        Err(AskError::Refused(reply)) => other(reply.message),
        Err(AskError::Silent) => Answer::None { reason: SILENCE.to_owned(), is_silent: true },
        Err(AskError::Unreadable(reason)) => other(format!("a head that cannot be used: {reason}")),
        Err(AskError::Zenoh(error)) => return Err(error.into()),
    })
}

/// The head of a map as the server has it now; `None` when the server says that it has no such map.
/// A server that is silent or busy is asked again, for as long as `patience`; every five seconds
/// that is logged (`WARN`).
///
/// # Errors
/// [`PublishError::NoAnswer`] when no server has answered by then, [`PublishError::Session`].
pub async fn find_head(
    session: &zenoh::Session,
    map: &MapName,
    patience: Duration,
) -> Result<Option<Head>, PublishError> {
    let begin = Instant::now();
    let mut remark_at = REMARK_EVERY;
    loop {
        let reason = match ask_head(session, map).await? {
            Answer::Head(head) => return Ok(Some(*head)),
            Answer::NoMap => return Ok(None),
            Answer::None { reason, .. } => reason,
        };
        if begin.elapsed() >= patience {
            let seconds = patience.as_secs_f64().ceil() as u64;
            return Err(PublishError::NoAnswer { map: map.clone(), seconds, reason });
        }
        if begin.elapsed() >= remark_at {
            remark_at = begin.elapsed() + REMARK_EVERY;
            tracing::warn!(target: "mapper::notice", "waiting for a map-server to tell whether there is a map '{map}': {reason}");
        }
        tokio::time::sleep(ASK_AGAIN).await;
    }
}
