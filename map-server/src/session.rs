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
    /// The address is taken.
    #[error("cannot listen on {}: the address is in use, perhaps by another map-server or router", listen.join(", "))]
    InUse {
        /// What should have been listened on.
        listen: Vec<String>,
    },
    /// The endpoint cannot be used.
    #[error("no session: {reason} (listening on [{}])", listen.join(", "))]
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

/// Zenoh's errors end in the place in its source where they arose, which helps nobody here.
fn without_source_paths(text: &str) -> String {
    text.split(" at /").next().unwrap_or(text).trim_end_matches('.').to_owned()
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
    zenoh::open(config).await.map_err(|error| {
        let (listen, reason) = (link.listen.clone(), without_source_paths(&error.to_string()));
        // Zenoh's errors are texts.
        if reason.contains("Address already in use") {
            SessionError::InUse { listen }
        } else {
            SessionError::Open { listen, reason }
        }
    })
}
