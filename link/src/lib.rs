//! Zenoh sessions. A robot is a client of the map server or of any router, and keeps trying to connect; the map server opens its own
//! in the same way.
//!
//! | module | idea |
//! | --- | --- |
//! | [`waiting`] | a session as a configuration says, waited for |
//! | [`credentials`] | whether certificates and keys can be read |
//! | [`trouble`] | why nobody answers |

pub mod credentials;
pub mod trouble;
pub mod waiting;

use std::path::PathBuf;
use waiting::{FOREVER, OpenError, endpoints, set_default};
use zenoh::Config;

/// A lost router is tried again after a tenth of a second, and at least every two seconds from then on.
const RETRY: &str = "{period_init_ms: 100, period_max_ms: 2000, period_increase_factor: 2}";
/// Where a robot looks for a server that was told nothing.
const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";
/// No endpoints, as Zenoh's configuration shows them.
const NONE: &str = "[]";

/// How a robot reaches the others.
#[derive(Clone, Debug)]
pub struct LinkConfig {
    /// Endpoints of the map server or of routers, such as `tcp/127.0.0.1:7447`. One connection is made: to the first one if it
    /// is there, else to whichever is. When it is lost, all are tried.
    pub connect: Vec<String>,
    /// A Zenoh configuration file (JSON5) to start from: endpoints, TLS, credentials. `connect` goes before what it says;
    /// whatever it leaves open is set as without a file.
    pub zenoh_config: Option<PathBuf>,
}

impl Default for LinkConfig {
    fn default() -> Self {
        Self::from_options(Vec::new(), None)
    }
}

impl LinkConfig {
    /// What `--connect` and `--zenoh-config` say. With neither the server is looked for on this machine.
    #[must_use]
    pub fn from_options(mut connect: Vec<String>, zenoh_config: Option<PathBuf>) -> Self {
        if connect.is_empty() && zenoh_config.is_none() {
            connect.push(DEFAULT_ENDPOINT.to_owned());
        }
        Self { connect, zenoh_config }
    }
}

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The configuration file cannot be read or is not understood.
    #[error("the Zenoh configuration {} is not accepted: {reason}", file.display())]
    File {
        /// Which.
        file: PathBuf,
        /// What Zenoh says.
        reason: String,
    },
    /// An option that Zenoh refuses.
    #[error("the endpoints {endpoints:?} are not accepted: {reason}")]
    Config {
        /// What was given.
        endpoints: Vec<String>,
        /// What Zenoh says.
        reason: String,
    },
    /// Nowhere to connect to.
    #[error("no endpoint: give --connect, or a --zenoh-config with connect.endpoints")]
    NoEndpoint,
    /// There is no session.
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// Opens the session. Waits until a server is there, without end, and says every half minute why it still waits ([`waiting::open`]): a
/// Zenoh client is nothing without its router, and as a peer, which would not wait, a robot would not hear other robots through it. Only a
/// file whose `connect.timeout_ms` is not −1 ends the waiting.
/// Once open, the session outlives the server: it connects again, and its subscriptions, queryables and tokens are declared
/// again. What is put meanwhile is lost, so whoever puts increments watches the head.
///
/// # Errors
/// [`LinkError`] when the configuration is no use or the session cannot be opened.
pub async fn open(link: &LinkConfig) -> Result<zenoh::Session, LinkError> {
    let config = config(link)?;
    if endpoints(&config).is_empty() {
        return Err(LinkError::NoEndpoint);
    }
    Ok(waiting::open(config, None).await?)
}

fn config(link: &LinkConfig) -> Result<Config, LinkError> {
    let mut config = match &link.zenoh_config {
        None => Config::default(),
        Some(file) => Config::from_file(file).map_err(|error| LinkError::File {
            file: file.clone(),
            reason: trouble::without_source_paths(&error.to_string()),
        })?,
    };
    let refused =
        |error: zenoh::Error| LinkError::Config { endpoints: link.connect.clone(), reason: error.to_string() };
    if !link.connect.is_empty() {
        let endpoints = serde_json::to_string(&link.connect).map_err(|error| refused(error.into()))?;
        config.insert_json5("connect/endpoints", &endpoints).map_err(refused)?;
    }
    for (key, value) in [
        ("mode", "\"client\""),
        // Nobody listens who was not told to.
        ("listen/endpoints", NONE),
        ("connect/timeout_ms", FOREVER),
        ("connect/exit_on_failure", "false"),
        ("connect/retry", RETRY),
        ("scouting/multicast/enabled", "false"),
    ] {
        set_default(&mut config, key, value).map_err(refused)?;
    }
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_file(text: &str, connect: &[&str]) -> Result<Config, LinkError> {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("zenoh.json5");
        std::fs::write(&file, text).unwrap();
        let connect = connect.iter().map(|&endpoint| endpoint.to_owned()).collect();
        config(&LinkConfig::from_options(connect, Some(file)))
    }

    #[test]
    fn a_robot_that_was_told_nothing_looks_on_this_machine() {
        assert_eq!(endpoints(&config(&LinkConfig::default()).unwrap()), [DEFAULT_ENDPOINT]);
    }

    #[test]
    fn a_configuration_file_is_obeyed_and_the_options_go_before_it() {
        let text = r#"{connect: {endpoints: ["tls/hall:7447", "tls/stairs:7447"], timeout_ms: 5},
            transport: {link: {tls: {root_ca_certificate: "ca.pem"}}}}"#;
        let config = with_file(text, &[]).unwrap();
        assert_eq!(endpoints(&config), ["tls/hall:7447", "tls/stairs:7447"]);
        assert_eq!(config.get_json("connect/timeout_ms").unwrap(), "5");
        assert!(config.get_json("transport/link/tls").unwrap().contains("ca.pem"));
        let overridden = with_file(text, &["tls/annex:7447"]).unwrap();
        assert_eq!(endpoints(&overridden), ["tls/annex:7447"]);
        assert!(overridden.get_json("transport/link/tls").unwrap().contains("ca.pem"));
        // What it leaves open.
        let rest = with_file("{}", &["tcp/hall:7447"]).unwrap();
        assert_eq!(rest.get_json("mode").unwrap(), "\"client\"");
        assert_eq!(rest.get_json("listen/endpoints").unwrap(), NONE);
        assert_eq!(rest.get_json("connect/timeout_ms").unwrap(), "-1");
        assert_eq!(rest.get_json("scouting/multicast/enabled").unwrap(), "false");
        assert!(endpoints(&with_file("{}", &[]).unwrap()).is_empty());
    }

    #[test]
    fn a_file_that_cannot_be_used_is_named() {
        let missing = LinkConfig::from_options(Vec::new(), Some("nowhere/zenoh.json5".into()));
        let error = config(&missing).unwrap_err().to_string();
        assert!(error.contains("nowhere/zenoh.json5") && error.contains("No such file"), "{error}");
        for text in ["{", "{mode: \"captain\"}", "{connect: {endpoints: [\"nonsense\"]}}"] {
            let error = with_file(text, &[]).unwrap_err().to_string();
            assert!(error.contains("zenoh.json5 is not accepted: ") && !error.contains(".rs:"), "{error}");
        }
    }
}
