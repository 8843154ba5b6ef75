//! The session of a robot or tool: a client of the map server or of a router.

use crate::configuration::{ConfigurationError, WAIT_BEFORE_DROP, read_config, set_default, set_endpoints};
use crate::credentials;
use crate::waiting::{ConnectError, FOREVER, endpoints, open_configured};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;
use zenoh::Config;

/// A lost router is tried again after 0.1 s, and then at least every 2 s.
const RETRY: &str = "{period_init_ms: 100, period_max_ms: 2000, period_increase_factor: 2}";
/// A router that does not answer is given up after so long, milliseconds: a frozen one still takes
/// connections. Zenoh's own 10 s would be waited for before the next router is asked.
const OPEN_TIMEOUT: &str = "3000";
/// Where a robot looks for a server unless told otherwise.
const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";
/// No endpoints, as Zenoh's configuration shows them.
const NONE: &str = "[]";

/// How a robot or tool reaches the map server.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct SessionConfig {
    /// Endpoints of the map server or of routers, such as `127.0.0.1:7447` or
    /// `tls/maps.example.com:7447`. One connection is made: to the first one if it is there, else
    /// to whichever is. When it is lost, all are tried. Default `tcp/127.0.0.1:7447`, unless a
    /// Zenoh configuration file is given.
    #[serde(rename = "endpoints")]
    pub connect: Vec<String>,
    /// A Zenoh configuration file (JSON5) to start from: endpoints, TLS, credentials. The endpoints
    /// above override it; whatever it leaves open is set as without a file. Default none.
    pub zenoh_config: Option<PathBuf>,
}

impl SessionConfig {
    /// What `--connect` and `--zenoh-config` say. With neither the server is looked for on this
    /// machine.
    #[must_use]
    pub fn from_options(connect: Vec<String>, zenoh_config: Option<PathBuf>) -> Self {
        Self { connect, zenoh_config }
    }

    /// Where the server is looked for, to be told to people: endpoints, or the file that says it.
    #[must_use]
    pub fn places(&self) -> String {
        match &self.zenoh_config {
            _ if !self.connect.is_empty() => self.connect.join(", "),
            Some(file) => format!("what {} says", file.display()),
            None => DEFAULT_ENDPOINT.to_owned(),
        }
    }
}

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The configuration file or an endpoint is of no use.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// Nowhere to connect to.
    #[error("no endpoint: give --connect, or a --zenoh-config with connect.endpoints")]
    NoEndpoint,
    /// There is no session.
    #[error(transparent)]
    Open(#[from] ConnectError),
}

impl SessionError {
    /// Whether what was given is wrong: a server that comes later would not help.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::Open(ConnectError::Listen { trouble, .. }) => trouble.is_input(),
            Self::Open(ConnectError::Refused { .. } | ConnectError::Open { .. }) => false,
            _ => true,
        }
    }
}

/// Opens the session of a robot or tool: a client of the server or router that `link` names.
///
/// It waits until a server is there, for as long as that takes, and logs every five seconds why it
/// still waits. A Zenoh client can do nothing without its router; a peer would not wait, but would
/// not hear other robots through the router either. Only a file whose `connect.timeout_ms` is not
/// −1 ends the wait.
///
/// The open session outlives the server: it reconnects and declares its subscriptions, queryables
/// and tokens again. What is put meanwhile is lost, so writers of increments watch the head.
///
/// # Errors
/// [`SessionError`] when the configuration is no use or the session cannot be opened.
pub async fn open(link: &SessionConfig) -> Result<zenoh::Session, SessionError> {
    open_within(link, None).await
}

/// The same, but with `patience` it gives up after that time, and says what kept it.
///
/// # Errors
/// [`SessionError`].
pub async fn open_within(link: &SessionConfig, patience: Option<Duration>) -> Result<zenoh::Session, SessionError> {
    let config = config(link)?;
    if endpoints(&config).is_empty() {
        return Err(SessionError::NoEndpoint);
    }
    Ok(open_configured(config, patience).await?)
}

/// Checks, before anybody connects, that the certificate which `link` names is not that of another
/// robot of the same `role` (`explorer`, `client`): routers with access control drop what a robot
/// writes under a name that is not its own, and nobody tells it.
///
/// # Errors
/// [`SessionError`], with both names.
pub fn check_owner(link: &SessionConfig, role: &'static str, name: &str) -> Result<(), SessionError> {
    let config = config(link)?;
    Ok(credentials::check_owner(&config, &endpoints(&config), role, name).map_err(ConnectError::from)?)
}

/// Checks, before anybody connects, that the certificate which `link` names lets a robot take
/// goals: an operator's does not.
///
/// # Errors
/// [`SessionError`], with the certificate.
pub fn check_serving(link: &SessionConfig) -> Result<(), SessionError> {
    let config = config(link)?;
    Ok(credentials::check_serving(&config, &endpoints(&config)).map_err(ConnectError::from)?)
}

fn config(link: &SessionConfig) -> Result<Config, ConfigurationError> {
    let mut config = read_config(link.zenoh_config.as_deref())?;
    let connect = match &link.zenoh_config {
        None if link.connect.is_empty() => &[DEFAULT_ENDPOINT.to_owned()],
        _ => link.connect.as_slice(),
    };
    if !connect.is_empty() {
        set_endpoints(&mut config, "connect/endpoints", connect)?;
    }
    for (key, value) in [
        ("mode", "\"client\""),
        // Nobody listens who was not told to.
        ("listen/endpoints", NONE),
        ("connect/timeout_ms", FOREVER),
        ("connect/exit_on_failure", "false"),
        ("connect/retry", RETRY),
        ("transport/unicast/open_timeout", OPEN_TIMEOUT),
        ("scouting/multicast/enabled", "false"),
        WAIT_BEFORE_DROP,
    ] {
        set_default(&mut config, key, value)?;
    }
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_file(text: &str, connect: &[&str]) -> Result<Config, ConfigurationError> {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("zenoh.json5");
        std::fs::write(&file, text).unwrap();
        let connect = connect.iter().map(|&endpoint| endpoint.to_owned()).collect();
        config(&SessionConfig::from_options(connect, Some(file)))
    }

    #[test]
    fn without_options_the_server_is_on_this_machine() {
        assert_eq!(endpoints(&config(&SessionConfig::default()).unwrap()), [DEFAULT_ENDPOINT]);
        assert_eq!(SessionConfig::default().places(), DEFAULT_ENDPOINT);
    }

    #[test]
    fn options_override_the_configuration_file() {
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
    fn an_unusable_file_is_named() {
        let missing = SessionConfig::from_options(Vec::new(), Some("nowhere/zenoh.json5".into()));
        let error = config(&missing).unwrap_err().to_string();
        assert!(error.contains("nowhere/zenoh.json5") && error.contains("No such file"), "{error}");
        for text in ["{", "{mode: \"captain\"}", "{connect: {endpoints: [\"nonsense\"]}}"] {
            let error = with_file(text, &[]).unwrap_err().to_string();
            assert!(error.contains("zenoh.json5 is not accepted: ") && !error.contains(".rs:"), "{error}");
        }
    }
}
