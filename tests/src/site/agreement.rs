//! What all servers of a site answer, and whether they agree.

use crate::site::config::SiteConfig;
use crate::site::report::SiteError;
use crate::site::sessions::map;
use fht_map::MapState;
use fht_proto::AuthorId;
use fht_proto::api::keys::{Key, Topic};
use fht_proto::api::reply::Head;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};
use zenoh::Session;
use zenoh::query::{ConsolidationMode, QueryTarget};

/// Waits until all servers agree with what was written, and returns whether they do, and how many
/// acknowledged increments the worst of them lacks.
pub(super) async fn agreement(
    watcher: &Session,
    config: &SiteConfig,
    expected: &MapState,
    acknowledged: &BTreeMap<AuthorId, u64>,
) -> Result<(bool, u64), SiteError> {
    let digest = expected.digest();
    let is_same = |head: &Head| head.digest == digest;
    let (heads, agree) = match all_heads(watcher, config.servers, config.patience, is_same).await {
        Ok(heads) => (heads, true),
        Err(SiteError::Late(why)) => {
            tracing::warn!("the servers do not agree on {expected}: {why}", expected = vector_of(acknowledged));
            (heads_of(watcher).await?, false)
        }
        Err(other) => return Err(other),
    };
    let lacks = |head: &Head| {
        acknowledged.iter().map(|(&author, &count)| count.saturating_sub(head.vector.get(author))).sum::<u64>()
    };
    Ok((agree, heads.iter().map(lacks).max().unwrap_or(u64::MAX)))
}

fn vector_of(acknowledged: &BTreeMap<AuthorId, u64>) -> String {
    let counts = acknowledged.iter().map(|(author, count)| format!("{author}:{count}"));
    counts.collect::<Vec<_>>().join(",")
}

/// The answers of all servers.
async fn answers_of_all(session: &Session, key: &Key) -> Result<Vec<Vec<u8>>, SiteError> {
    let replies = session
        .get(key.to_string())
        .target(QueryTarget::All)
        .consolidation(ConsolidationMode::None)
        .timeout(Duration::from_secs(2))
        .await?;
    let mut answers = Vec::new();
    while let Ok(reply) = replies.recv_async().await {
        answers.extend(reply.result().ok().map(|sample| sample.payload().to_bytes().into_owned()));
    }
    Ok(answers)
}

async fn heads_of(session: &Session) -> Result<Vec<Head>, SiteError> {
    let answers = answers_of_all(session, &Key::topic(&map(), Topic::Head)).await?;
    Ok(answers.iter().filter_map(|answer| serde_json::from_slice(answer).ok()).collect())
}

/// Waits until all servers answer.
pub(super) async fn until_all_answer(session: &Session, config: &SiteConfig) -> Result<(), SiteError> {
    let begin = Instant::now();
    while answers_of_all(session, &Key::Maps).await?.len() < config.servers {
        if begin.elapsed() > config.patience {
            return Err(SiteError::Late("not all servers answer".to_owned()));
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
    Ok(())
}

/// Waits until `count` servers answer, each with a head that is `good`.
async fn all_heads(
    session: &Session,
    count: usize,
    patience: Duration,
    good: impl Fn(&Head) -> bool,
) -> Result<Vec<Head>, SiteError> {
    let begin = Instant::now();
    loop {
        let heads = heads_of(session).await?;
        if heads.len() == count && heads.iter().all(&good) {
            return Ok(heads);
        }
        if begin.elapsed() > patience {
            let seen: Vec<String> = heads.iter().map(|head| head.vector.to_string()).collect();
            return Err(SiteError::Late(format!("of {count} servers these answer as they should: {seen:?}")));
        }
        tokio::time::sleep(Duration::from_millis(200)).await;
    }
}
