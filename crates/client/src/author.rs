//! Writing to a map: numbered, stamped increments, acknowledged by the server's head.

use crate::queries::{AskError, ask_head_async, ask_until_answered};
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::{ErrorCode, ErrorReply, Head, Series};
use fht_proto::{AuthorId, CodecError, Increment, MapName, Op, ParseIdError, RobotName, decode, encode};
use fht_session::in_words;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::handlers::RingChannel;
use zenoh::qos::CongestionControl;

/// How long the server has to store an increment.
const STORE_TIMEOUT: Duration = Duration::from_secs(10);
/// The server is asked what it has this often.
const ASK_EVERY: Duration = Duration::from_millis(250);
/// Without news it is put again after this time: it may be lost, and who was refused a moment ago
/// is not told again at once.
const PUT_AGAIN: Duration = Duration::from_millis(1500);
/// Two programs of one author may take the same number: so often another one is tried.
const TRIES: usize = 30;

/// Why an increment was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotWritten {
    /// Zenoh refused.
    #[error("Zenoh refuses: {}", in_words(.0))]
    Zenoh(#[from] zenoh::Error),
    /// The author's name is none.
    #[error(transparent)]
    Name(#[from] ParseIdError),
    /// The server did not say what it has.
    #[error(transparent)]
    Ask(#[from] AskError),
    /// It was sent, and since then the server does not answer.
    #[error("no map-server has answered since it was sent: it may have been carried out")]
    Unanswered,
    /// The server refused the increment, with its reason.
    #[error("{0}")]
    Refused(ErrorReply),
    /// The operations are no increment that anybody would take.
    #[error("it cannot be written: {0}")]
    Invalid(#[from] CodecError),
    /// The server has not stored it.
    #[error(
        "the server has not stored it within {seconds} s: may this author write (access control drops silently), and \
         do enough storages answer? It may still be carried out"
    )]
    NotStored {
        /// How long was waited.
        seconds: u64,
    },
    /// Another program took every number that was tried, or the one that was meant.
    #[error("somebody else writes as {author} at this moment: write again, or under another name")]
    Contended {
        /// The author's name.
        author: String,
    },
}

/// A refusal that knows an author by its id alone, with its name.
fn named(reply: ErrorReply, author: &AuthorId, name: &str) -> ErrorReply {
    let message = reply.message.replace(&format!("author {author}"), &format!("{name} (author {author})"));
    ErrorReply { message, ..reply }
}

/// Now, microseconds since 1970.
fn now_us() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since.as_micros()).unwrap_or(u64::MAX)
}

/// Who writes, and how.
#[derive(Clone, Copy, Debug)]
pub struct Authorship<'a> {
    /// The author's name.
    pub name: &'a str,
    /// Whether a map that does not exist yet is begun.
    pub may_begin: bool,
    /// How long the server may take for an answer.
    pub timeout: Duration,
}

async fn head_of(session: &Session, map: &MapName, author: &Authorship<'_>) -> Result<Head, AskError> {
    match ask_head_async(session, map, author.timeout).await {
        Err(AskError::Refused(reply)) if author.may_begin && reply.code == ErrorCode::UnknownMap => {
            Ok(Head::of_nothing(map.clone()))
        }
        outcome => outcome,
    }
}

/// Writes `ops` as one increment, and returns the head that contains it.
///
/// # Errors
/// [`NotWritten`].
pub async fn write(session: &Session, map: &MapName, by: Authorship<'_>, ops: Vec<Op>) -> Result<Head, NotWritten> {
    write_as(session, map, by, None, ops).await
}

/// Writes `ops` as the author's increment of this number, for they stand on those before it.
///
/// # Errors
/// [`NotWritten`]; [`NotWritten::Contended`] if there is another one of this number.
pub async fn write_numbered(
    session: &Session,
    map: &MapName,
    by: Authorship<'_>,
    number: u64,
    ops: Vec<Op>,
) -> Result<Head, NotWritten> {
    write_as(session, map, by, Some(number), ops).await
}

async fn write_as(
    session: &Session,
    map: &MapName,
    by: Authorship<'_>,
    only: Option<u64>,
    ops: Vec<Op>,
) -> Result<Head, NotWritten> {
    let author = AuthorId::of_robot(by.name.parse::<RobotName>()?.as_str());
    let refused = Key::refused(map, author).to_string();
    let refusals = session.declare_subscriber(refused).with(RingChannel::new(4)).await?;
    for _ in 0..TRIES {
        let before = head_of(session, map, &by).await?;
        let number = before.vector.get(author) + 1;
        if only.is_some_and(|only| only != number) {
            break;
        }
        // Newer than everything that the map has seen.
        let hlc_us = now_us().max(before.clock_us + 1);
        let increment = Increment { author, number, hlc_us, ops: ops.clone() };
        let (key, bytes) = (Key::increment(map, author, number).to_string(), encode(&increment)?);
        let (begin, mut put_at) = (Instant::now(), None::<Instant>);
        loop {
            if put_at.is_none_or(|at| at.elapsed() >= PUT_AGAIN) {
                put_at = Some(Instant::now());
                session
                    .put(&key, bytes.clone())
                    .encoding(Encoding::APPLICATION_OCTET_STREAM)
                    // The author's id does not lead back to it: so servers know whom they name.
                    .attachment(by.name)
                    .congestion_control(CongestionControl::Block)
                    .await?;
            }
            if let Ok(Some(sample)) = refusals.try_recv()
                && let Ok(reply) = serde_json::from_slice::<ErrorReply>(&sample.payload().to_bytes())
                && reply.code != ErrorCode::Conflict
            {
                return Err(NotWritten::Refused(named(reply, &author, by.name)));
            }
            let now = head_of(session, map, &by).await.map_err(since_sent)?;
            if now.vector.get(author) >= number {
                if is_stored(session, map, &before, &increment, by.timeout).await.map_err(since_sent)? {
                    return Ok(now);
                }
                break; // another program of this author was faster
            }
            if begin.elapsed() >= STORE_TIMEOUT {
                return Err(NotWritten::NotStored { seconds: STORE_TIMEOUT.as_secs() });
            }
            tokio::time::sleep(ASK_EVERY.min(Duration::from_millis(20) + begin.elapsed())).await;
        }
    }
    Err(NotWritten::Contended { author: by.name.to_owned() })
}

/// Why nothing is known of what was sent.
fn since_sent(error: AskError) -> NotWritten {
    match error {
        AskError::Silent => NotWritten::Unanswered,
        error => error.into(),
    }
}

/// Whether the server stored this increment under its number, and not somebody else's.
async fn is_stored(
    session: &Session,
    map: &MapName,
    before: &Head,
    increment: &Increment,
    timeout: Duration,
) -> Result<bool, AskError> {
    let selector = format!("{}?vector={}", Key::topic(map, Topic::Since), before.vector);
    let bytes = ask_until_answered(session, &selector, timeout).await?;
    let series: Series = decode(&bytes).map_err(|error| AskError::Unreadable(error.to_string()))?;
    let place = |stored: &&Increment| (stored.author, stored.number) == (increment.author, increment.number);
    Ok(series.increments.iter().find(place).is_none_or(|stored| stored == increment))
}
