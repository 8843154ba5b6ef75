//! The robot's Zenoh session: a client of the map server or of any router, which keeps trying to connect.

use zenoh::Config;

/// How a robot reaches the others.
#[derive(Clone, Debug)]
pub struct LinkConfig {
    /// Endpoints of the map server or of a router, such as `tcp/127.0.0.1:7447`. The first that answers is used.
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

/// Opens the session.
///
/// # Errors
/// [`LinkError`] when the endpoints are malformed or the session cannot be opened.
pub async fn open(link: &LinkConfig) -> Result<zenoh::Session, LinkError> {
    let config = config(link).map_err(|error| LinkError::Config {
        endpoints: link.connect.clone(),
        reason: error.to_string(),
    })?;
    zenoh::open(config)
        .await
        .map_err(|error| LinkError::Open { endpoints: link.connect.clone(), reason: error.to_string() })
}

fn config(link: &LinkConfig) -> Result<Config, zenoh::Error> {
    let mut config = Config::default();
    let endpoints = serde_json::to_string(&link.connect)?;
    config.insert_json5("mode", "\"client\"")?;
    config.insert_json5("connect/endpoints", &endpoints)?;
    config.insert_json5("connect/timeout_ms", "-1")?;
    config.insert_json5("connect/exit_on_failure", "false")?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    Ok(config)
}
