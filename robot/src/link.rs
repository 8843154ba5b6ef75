//! The robot's Zenoh session: a client of the map server or of any router, which keeps trying to connect.

use std::future::IntoFuture;
use std::pin::pin;
use std::time::Duration;
use zenoh::Config;

/// A session that takes longer to open is remarked upon.
const PATIENCE: Duration = Duration::from_secs(3);

/// A lost router is tried again after a tenth of a second, and at least every two seconds from then on.
const RETRY: &str = "{period_init_ms: 100, period_max_ms: 2000, period_increase_factor: 2}";

/// How a robot reaches the others.
#[derive(Clone, Debug)]
pub struct LinkConfig {
    /// Endpoints of the map server or of a router, such as `tcp/127.0.0.1:7447`. Zenoh waits for the first one; the others
    /// are tried when a connection is lost.
    pub connect: Vec<String>,
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self { connect: vec!["tcp/127.0.0.1:7447".to_owned()] }
    }
}

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// An option that Zenoh refuses.
    #[error("the endpoints {endpoints:?} are not accepted: {reason}")]
    Config {
        /// What was given.
        endpoints: Vec<String>,
        /// What Zenoh says.
        reason: String,
    },
    /// Zenoh opens no session.
    #[error("no session with {endpoints:?}: {reason}")]
    Open {
        /// Where to.
        endpoints: Vec<String>,
        /// What Zenoh says.
        reason: String,
    },
}

/// Opens the session. Waits until the server is there, without end: a Zenoh client is nothing without its router, and as a
/// peer, which would not wait, a robot would not hear other robots through it. Once open, the session outlives the server:
/// it connects again, and its subscriptions, queryables and tokens are declared again. What is put meanwhile is lost, so
/// whoever puts increments watches the head.
///
/// # Errors
/// [`LinkError`] when the endpoints are malformed or the session cannot be opened.
pub async fn open(link: &LinkConfig) -> Result<zenoh::Session, LinkError> {
    let config = config(link)
        .map_err(|error| LinkError::Config { endpoints: link.connect.clone(), reason: error.to_string() })?;
    let mut opening = pin!(zenoh::open(config).into_future());
    let outcome = match tokio::time::timeout(PATIENCE, &mut opening).await {
        Ok(outcome) => outcome,
        Err(_) => {
            tracing::warn!("waiting for a server at {}", link.connect.join(", "));
            opening.await
        }
    };
    outcome.map_err(|error| LinkError::Open { endpoints: link.connect.clone(), reason: error.to_string() })
}

fn config(link: &LinkConfig) -> Result<Config, zenoh::Error> {
    let mut config = Config::default();
    let endpoints = serde_json::to_string(&link.connect)?;
    config.insert_json5("mode", "\"client\"")?;
    config.insert_json5("connect/endpoints", &endpoints)?;
    config.insert_json5("connect/timeout_ms", "-1")?;
    config.insert_json5("connect/exit_on_failure", "false")?;
    config.insert_json5("connect/retry", RETRY)?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    Ok(config)
}
