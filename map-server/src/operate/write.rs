//! Operators' increments: numbered and stamped like any other author's.

use super::{OperateError, ask, head};
use crate::now_us;
use fht_proto::keys::{Key, Topic};
use fht_proto::query::{ErrorCode, ErrorReply, Head, Snapshot};
use fht_proto::{AuthorId, Increment, MapName, Op, decode, encode};
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::bytes::Encoding;
use zenoh::handlers::RingChannel;
use zenoh::qos::CongestionControl;

/// How long the server has to store an increment.
const STORE_TIMEOUT: Duration = Duration::from_secs(10);
/// The server is asked what it has this often.
const ASK_EVERY: Duration = Duration::from_millis(250);
/// Two terminals of one operator may take the same number: so often another one is tried.
const TRIES: usize = 5;

/// Writes `ops` as one increment of the operator called `operator`; returns the head that contains it.
pub(super) async fn write(
    session: &Session,
    map: &MapName,
    operator: &str,
    ops: Vec<Op>,
) -> Result<Head, OperateError> {
    let author = AuthorId::of_robot(operator);
    let refused = Key::refused(map, author).to_string();
    let refusals = session.declare_subscriber(refused).with(RingChannel::new(4)).await?;
    for _ in 0..TRIES {
        let before = head(session, map).await?;
        let number = before.vector.get(author) + 1;
        // Newer than everything that the map has seen.
        let hlc_us = now_us().max(before.clock_us + 1);
        let increment = Increment { author, number, hlc_us, ops: ops.clone() };
        let bytes = encode(&increment).map_err(|error| OperateError::Usage(error.to_string()))?;
        session
            .put(Key::increment(map, author, number).to_string(), bytes)
            .encoding(Encoding::APPLICATION_OCTET_STREAM)
            .congestion_control(CongestionControl::Block)
            .await?;
        let begin = Instant::now();
        loop {
            if let Ok(Some(sample)) = refusals.try_recv()
                && let Ok(reply) = serde_json::from_slice::<ErrorReply>(&sample.payload().to_bytes())
                && reply.code != ErrorCode::Conflict
            {
                return Err(OperateError::Refused(reply));
            }
            let now = head(session, map).await?;
            if now.vector.get(author) >= number {
                if is_stored(session, map, &before, &increment).await? {
                    return Ok(now);
                }
                break; // another terminal was faster
            }
            if begin.elapsed() >= STORE_TIMEOUT {
                return Err(OperateError::NotStored { seconds: STORE_TIMEOUT.as_secs() });
            }
            tokio::time::sleep(ASK_EVERY.min(Duration::from_millis(20) + begin.elapsed())).await;
        }
    }
    Err(OperateError::Usage(format!("somebody else writes as {operator} all the time: give another --operator")))
}

/// Whether the server stored this increment under its number, and not somebody else's.
async fn is_stored(
    session: &Session,
    map: &MapName,
    before: &Head,
    increment: &Increment,
) -> Result<bool, OperateError> {
    let selector = format!("{}?vector={}", Key::topic(map, Topic::Since), before.vector);
    let bytes = ask(session, &selector, None).await?;
    let series: Snapshot = decode(&bytes).map_err(|error| OperateError::Answer(error.to_string()))?;
    let place = |stored: &&Increment| (stored.author, stored.number) == (increment.author, increment.number);
    Ok(series.increments.iter().find(place).is_none_or(|stored| stored == increment))
}
