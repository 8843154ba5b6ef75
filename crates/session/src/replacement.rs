//! A new session in place of one that routers refuse.
//!
//! A router takes one session of each Zenoh id. Ids are no secrets: whoever is answered learns the
//! id of who answered. Somebody else with a certificate of the site may so come to the other
//! routers under this session's id; when its own router is lost, the others refuse it, for as long
//! as the other one stays. Zenoh tries again for ever, and a session cannot change its id.

use crate::attempt::attempt;
use crate::configuration::set;
use crate::waiting::has;
use std::time::{Duration, Instant};
use zenoh::{Config, Session};

/// How often a session is looked at.
const EVERY: Duration = Duration::from_secs(1);
/// So long a session may be without a router before another id is tried, and so long routers have
/// to let in others and not this one: longer than Zenoh waits between two attempts of its own.
const ALONE: Duration = Duration::from_secs(4);
/// So often it is said again that no router is reached.
const SAY_AGAIN: Duration = Duration::from_secs(60);
/// So long the old session may take to end. Nobody hears it.
const FAREWELL: Duration = Duration::from_secs(2);

/// Waits until the routers of `config` refuse `session` but let in one with another id, and returns
/// that one. For a session that listens, or that is no client, this is never.
///
/// Routers that are not there, or refuse every id, are waited for.
pub async fn replacement(session: &Session, config: &Config) -> Session {
    let mut config = config.clone();
    let is_ready = has(&config, "mode", "\"client\"")
        && ["id", "connect/timeout_ms"]
            .into_iter()
            .zip(["null", "0"])
            .all(|(key, value)| set(&mut config, key, value).is_ok());
    if !is_ready {
        std::future::pending::<()>().await;
    }
    let (mut alone_since, mut refused_since, mut said) = (None::<Instant>, None, None::<Instant>);
    loop {
        tokio::time::sleep(EVERY).await;
        if is_connected(session).await {
            if let Some(since) = alone_since.filter(|_| said.is_some()) {
                tracing::warn!("a router is reached again, after {} s", since.elapsed().as_secs());
            }
            (alone_since, refused_since, said) = (None, None, None);
            continue;
        }
        let since = *alone_since.get_or_insert_with(Instant::now);
        if since.elapsed() < ALONE {
            continue;
        }
        if said.is_none_or(|said| said.elapsed() >= SAY_AGAIN) {
            let seconds = since.elapsed().as_secs();
            tracing::warn!("no router has been reached for {seconds} s: nobody hears this session; it tries again");
            said = Some(Instant::now());
        }
        let Ok(other) = attempt(config.clone()).await else {
            refused_since = None;
            continue;
        };
        // Routers that have just come up let in whoever asks first: this session's turn comes, too.
        let since = *refused_since.get_or_insert_with(Instant::now);
        if is_connected(session).await || since.elapsed() < ALONE {
            let _ = other.close().await; // it is not needed
            continue;
        }
        tracing::warn!(
            "the routers refuse the session {}, and take another one: somebody else came to them under its id, \
             with a certificate of this site. Going on as {}",
            session.zid(),
            other.zid()
        );
        return other;
    }
}

/// Ends a session that nobody hears any more.
pub async fn abandon(session: Session) {
    let _ = tokio::time::timeout(FAREWELL, session.close()).await; // whatever it was, it is no use
}

async fn is_connected(session: &Session) -> bool {
    session.info().routers_zid().await.next().is_some() || session.info().peers_zid().await.next().is_some()
}
