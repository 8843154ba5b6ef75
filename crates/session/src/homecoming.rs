//! Back to the first router, once it is there again.
//!
//! Zenoh's client goes to the next router when it loses its own, and stays there. In time all
//! servers of a site would so come to hang on one router, and be lost together with it.

use crate::attempt::attempt;
use crate::configuration::{set, set_endpoints};
use crate::waiting::{endpoints, has};
use std::time::Duration;
use zenoh::config::ZenohId;
use zenoh::{Config, Session};

/// How often it is looked for.
const EVERY: Duration = Duration::from_secs(5);

/// Waits until `session` is at another router than the first that `config` names, and the first has
/// been there for two looks of five seconds. Returns a session that is there. For a session with
/// one router, or that is no client, this is never.
pub async fn homecoming(session: &Session, config: &Config) -> Session {
    let Some(ways) = Ways::of(config) else { return std::future::pending().await };
    let (mut home, mut was_there) = (None, false);
    loop {
        tokio::time::sleep(EVERY).await;
        let here = router_of(session).await;
        // A session without a router looks for one itself.
        if here.is_none() || here == home {
            was_there = false;
            continue;
        }
        home = ways.look().await;
        let is_elsewhere = home.is_some() && home != here;
        if is_elsewhere
            && was_there
            && let Some(other) = ways.go(home).await
        {
            tracing::info!("goes back to its first router, which is there again");
            return other;
        }
        was_there = is_elsewhere;
    }
}

/// How to come to the first router.
struct Ways {
    /// To it or to none.
    only_first: Config,
    /// To it before all others.
    any: Config,
}

impl Ways {
    fn of(config: &Config) -> Option<Self> {
        let all = endpoints(config);
        if all.len() < 2 || !has(config, "mode", "\"client\"") {
            return None;
        }
        let mut any = config.clone();
        for (key, value) in [("id", "null"), ("connect/timeout_ms", "0")] {
            set(&mut any, key, value).ok()?;
        }
        let mut only_first = any.clone();
        set_endpoints(&mut only_first, "connect/endpoints", &all[..1]).ok()?;
        Some(Self { only_first, any })
    }

    /// Which router is the first, if it is there.
    async fn look(&self) -> Option<ZenohId> {
        let session = attempt(self.only_first.clone()).await.ok()?;
        let found = router_of(&session).await;
        let _ = session.close().await; // it was only to look
        found
    }

    /// A session with the router `home`.
    async fn go(&self, home: Option<ZenohId>) -> Option<Session> {
        let session = attempt(self.any.clone()).await.ok()?;
        if router_of(&session).await == home {
            return Some(session);
        }
        let _ = session.close().await; // it has come elsewhere
        None
    }
}

/// The router of a client, if it has one.
async fn router_of(session: &Session) -> Option<ZenohId> {
    session.info().routers_zid().await.next()
}
