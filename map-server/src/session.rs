//! The server's Zenoh session: a router when it listens, a client of other routers otherwise.

use crate::config::LinkConfig;
use zenoh::{Config, Session};

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Neither to listen nor to connect.
    #[error("no endpoint: give --listen, --connect or both")]
    NoEndpoint,
    /// The configuration file or an endpoint is not understood.
    #[error("the Zenoh configuration is refused: {0}")]
    Config(zenoh::Error),
    /// The endpoint cannot be used.
    #[error("cannot listen on {listen:?}: {reason}")]
    Open {
        /// What should have been listened on.
        listen: Vec<String>,
        /// What Zenoh says.
        reason: String,
    },
}

fn to_zenoh(link: &LinkConfig) -> Result<Config, zenoh::Error> {
    let mut config = link.zenoh_config.as_ref().map_or_else(|| Ok(Config::default()), Config::from_file)?;
    // A router puts its clients in touch with each other: explorers, robots and tools need no other program between them.
    let mode = if link.listen.is_empty() { "client" } else { "router" };
    config.insert_json5("mode", &serde_json::to_string(mode)?)?;
    config.insert_json5("listen/endpoints", &serde_json::to_string(&link.listen)?)?;
    config.insert_json5("connect/endpoints", &serde_json::to_string(&link.connect)?)?;
    // Other routers may come up later than this one.
    config.insert_json5("connect/timeout_ms", "-1")?;
    config.insert_json5("connect/exit_on_failure", "false")?;
    config.insert_json5("scouting/multicast/enabled", "false")?;
    Ok(config)
}

/// Opens the session.
///
/// # Errors
/// [`SessionError`]; an address that is in use, above all.
pub async fn open(link: &LinkConfig) -> Result<Session, SessionError> {
    if link.listen.is_empty() && link.connect.is_empty() {
        return Err(SessionError::NoEndpoint);
    }
    let config = to_zenoh(link).map_err(SessionError::Config)?;
    let failed = |error: zenoh::Error| SessionError::Open { listen: link.listen.clone(), reason: error.to_string() };
    zenoh::open(config).await.map_err(failed)
}
