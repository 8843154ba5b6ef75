//! The server's Zenoh session: a router when it listens, a client of other routers otherwise.

use crate::config::ServerEndpoints;
use fht_session::{
    ConfigurationError, ConnectError, WAIT_BEFORE_DROP, listening_at, read_config, set, set_default, set_endpoints,
};
use zenoh::{Config, Session};

/// Why there is no session.
#[derive(Debug, thiserror::Error)]
pub enum ServerSessionError {
    /// There is neither an endpoint to listen on nor one to connect to.
    #[error("no endpoint: give --listen, --connect or both, or a --zenoh-config with endpoints")]
    NoEndpoint,
    /// The configuration file or an endpoint is not understood.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// Nobody is there to connect to, the address to listen on cannot be had, or a certificate or
    /// key is unusable.
    #[error(transparent)]
    Link(#[from] ConnectError),
}

impl ServerSessionError {
    /// Whether what was given is wrong.
    #[must_use]
    pub fn is_input(&self) -> bool {
        match self {
            Self::NoEndpoint | Self::Configuration(_) | Self::Link(ConnectError::Credentials(_)) => true,
            Self::Link(ConnectError::Listen { trouble, .. }) => trouble.is_input(),
            Self::Link(_) => false,
        }
    }
}

/// A lost router is tried again after a tenth of a second, then at least every two seconds.
const RETRY: &str = "{period_init_ms: 100, period_max_ms: 2000, period_increase_factor: 2}";
/// A router drops what a link cannot take instead of waiting for it: Zenoh would block the thread
/// that delivers messages to others, for seconds, and then close the transport. Nothing is lost:
/// whoever lacks an increment asks for it. Replies travel as their queries did.
const DROP_RATHER_THAN_WAIT: &str = r#"[
    {id: "puts", messages: ["put", "delete"], flows: ["egress"], overwrite: {congestion_control: "drop"}},
    {id: "queries", messages: ["query"], flows: ["ingress"], overwrite: {congestion_control: "drop"}},
]"#;

/// Robots and tools at one time. Zenoh's own default is 1000.
const MAX_SESSIONS: &str = "4000";
/// Connections on their way in: Zenoh's own 100 are used up by the silent ones of one robot.
const ACCEPT_PENDING: &str = "2000";
/// How long each of them may take, milliseconds. Not less: a server that many robots connect to at
/// once takes its time, and Zenoh gives sessions up when they are open already: their robots are
/// connected and never heard. Sites with strangers have less (`deploy/`).
const ACCEPT_TIMEOUT: &str = "30000";
/// A router that does not answer is given up after so long for the next one, milliseconds.
const OPEN_TIMEOUT: &str = "3000";

/// No endpoints, as Zenoh's configuration shows them.
const NONE: &str = "[]";

/// The configuration that a session is opened with.
///
/// # Errors
/// [`ConfigurationError`].
pub fn to_zenoh(link: &ServerEndpoints) -> Result<Config, ConfigurationError> {
    let mut config = read_config(link.zenoh_config.as_deref())?;
    for (key, endpoints) in [("listen/endpoints", &link.listen), ("connect/endpoints", &link.connect)] {
        if endpoints.is_empty() {
            // Zenoh listens on all interfaces by default.
            set_default(&mut config, key, NONE)?;
        } else {
            set_endpoints(&mut config, key, endpoints)?;
        }
    }
    // A router connects its clients: explorers, robots and tools need no other program between
    // them.
    let is_client = config.get_json("listen/endpoints").is_ok_and(|listen| listen == NONE);
    set_default(&mut config, "mode", if is_client { "\"client\"" } else { "\"router\"" })?;
    if !is_client {
        set_default(&mut config, "qos/network", DROP_RATHER_THAN_WAIT)?;
        for (key, value) in [
            ("transport/unicast/max_sessions", MAX_SESSIONS),
            ("transport/unicast/accept_pending", ACCEPT_PENDING),
            ("transport/unicast/accept_timeout", ACCEPT_TIMEOUT),
        ] {
            set_default(&mut config, key, value)?;
        }
    }
    for (key, value) in [WAIT_BEFORE_DROP, ("transport/unicast/open_timeout", OPEN_TIMEOUT)] {
        set_default(&mut config, key, value)?;
    }
    match link.patience {
        // Other routers may start later than this one.
        None => {
            set_default(&mut config, "connect/timeout_ms", "-1")?;
            set_default(&mut config, "connect/exit_on_failure", "false")?;
            if is_client {
                set_default(&mut config, "connect/retry", RETRY)?;
            }
        }
        // For all but clients, Zenoh itself has to end the waiting.
        Some(patience) => {
            // With 0 it would not wait at all, and say less of why.
            set(&mut config, "connect/timeout_ms", &patience.as_millis().max(1).to_string())?;
            set(&mut config, "connect/exit_on_failure", "true")?;
        }
    }
    set_default(&mut config, "scouting/multicast/enabled", "false")?;
    Ok(config)
}

/// Whether another session can be reached.
fn reaches_anyone(config: &Config) -> bool {
    let is = |key: &str, value: &str| config.get_json(key).is_ok_and(|set| set == value);
    !is("listen/endpoints", NONE) || !is("connect/endpoints", NONE) || is("scouting/multicast/enabled", "true")
}

/// The endpoints of a configuration that other machines may reach, if they find no access control
/// there.
fn exposed(config: &Config) -> Vec<String> {
    if config.get_json("access_control/enabled").is_ok_and(|enabled| enabled == "true") {
        return Vec::new();
    }
    let mut endpoints = listening_at(config);
    endpoints.retain(|endpoint| !is_on_this_machine(endpoint));
    endpoints
}

fn is_on_this_machine(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or(endpoint, |(_, address)| address);
    ["127.", "localhost:", "[::1]"].iter().any(|here| address.starts_with(here)) || endpoint.starts_with("unix")
}

/// What to warn of before a server is opened: the endpoints at which every stranger may write.
///
/// # Errors
/// [`ConfigurationError`].
pub fn open_to_strangers(link: &ServerEndpoints) -> Result<Vec<String>, ConfigurationError> {
    Ok(exposed(&to_zenoh(link)?))
}

/// Checks that a server has no robot's or operator's certificate, which would let it answer nobody.
///
/// # Errors
/// [`ServerSessionError`].
pub fn check_certificate(link: &ServerEndpoints) -> Result<(), ServerSessionError> {
    Ok(fht_session::check_server(&to_zenoh(link)?)?)
}

/// The server's name in the certificate that it shows to routers, if it is a server's.
pub fn own_name(link: &ServerEndpoints) -> Option<String> {
    fht_session::server_name(&to_zenoh(link).ok()?)
}

/// Opens the session. A client waits for its routers and tries all of them
/// ([`fht_session::open_configured`]).
///
/// # Errors
/// [`ServerSessionError`]; above all, an address that is in use.
pub async fn open(link: &ServerEndpoints) -> Result<Session, ServerSessionError> {
    let config = to_zenoh(link)?;
    if !reaches_anyone(&config) {
        return Err(ServerSessionError::NoEndpoint);
    }
    Ok(fht_session::open_configured(config, link.patience).await?)
}

/// Waits until another session is to take the place of this one, and returns it: the routers refuse
/// this one because of its id ([`fht_session::replacement`]), or its first router is there again
/// ([`fht_session::homecoming`]). Meanwhile a router that is linked to no other says so.
pub async fn successor(session: &Session, link: &ServerEndpoints) -> Session {
    match to_zenoh(link) {
        Ok(config) => tokio::select! {
            session = fht_session::replacement(session, &config) => session,
            session = fht_session::homecoming(session, &config) => session,
            never = fht_session::remark_while_alone(session, &config) => match never {},
        },
        // The file has become unusable since the session was opened: there is nothing to open
        // another with.
        Err(_) => std::future::pending().await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn json(config: &Config, key: &str) -> String {
        config.get_json(key).unwrap()
    }

    #[test]
    fn a_configuration_file_is_obeyed() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("zenoh.json5");
        let text = r#"{mode: "peer", listen: {endpoints: ["tls/0.0.0.0:7448"]}, connect: {timeout_ms: 5},
            scouting: {multicast: {enabled: true}}}"#;
        std::fs::write(&file, text).unwrap();
        let mut link = ServerEndpoints { zenoh_config: Some(file.clone()), ..ServerEndpoints::default() };
        let config = to_zenoh(&link).unwrap();
        assert!(json(&config, "listen/endpoints").contains("tls/0.0.0.0:7448"));
        assert_eq!(json(&config, "mode"), "\"peer\"");
        assert_eq!(json(&config, "connect/timeout_ms"), "5");
        assert_eq!(json(&config, "scouting/multicast/enabled"), "true");

        link.listen = vec!["tcp/127.0.0.1:1".to_owned()];
        let listen = json(&to_zenoh(&link).unwrap(), "listen/endpoints");
        assert!(listen.contains("tcp/127.0.0.1:1") && !listen.contains("7448"), "{listen}");

        // What the file leaves open; above all, a server listens only where it was told to.
        std::fs::write(&file, "{}").unwrap();
        let router = to_zenoh(&link).unwrap();
        assert_eq!(json(&router, "mode"), "\"router\"");
        assert_eq!(json(&router, "scouting/multicast/enabled"), "false");
        link.listen.clear();
        assert!(!reaches_anyone(&to_zenoh(&link).unwrap()));
        link.connect = vec!["tcp/127.0.0.1:1".to_owned()];
        let client = to_zenoh(&link).unwrap();
        assert_eq!((json(&client, "mode").as_str(), json(&client, "listen/endpoints").as_str()), ("\"client\"", NONE));
        assert!(reaches_anyone(&client));
        for config in [router, client] {
            assert_eq!(json(&config, WAIT_BEFORE_DROP.0), WAIT_BEFORE_DROP.1);
        }
    }

    #[test]
    fn strangers_reach_what_listens_beyond_this_machine_without_access_control() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("zenoh.json5");
        let link = |listen: &[&str], zenoh_config| ServerEndpoints {
            listen: listen.iter().map(|&endpoint| endpoint.to_owned()).collect(),
            zenoh_config,
            ..ServerEndpoints::default()
        };
        let here = ["tcp/127.0.0.1:1", "tcp/localhost:1", "tcp/[::1]:1"];
        assert_eq!(open_to_strangers(&link(&here, None)).unwrap(), Vec::<String>::new());
        let everywhere = ["tcp/0.0.0.0:1", "tcp/[::]:1", "tls/maps:1"];
        assert_eq!(open_to_strangers(&link(&everywhere, None)).unwrap(), everywhere);
        for (enabled, expected) in [(true, 0), (false, 1)] {
            let text = format!(
                "{{listen: {{endpoints: ['tls/[::]:1']}}, access_control: {{enabled: {enabled}, default_permission: 'deny',
                    rules: [], subjects: [], policies: []}}}}"
            );
            std::fs::write(&file, text).unwrap();
            assert_eq!(open_to_strangers(&link(&[], Some(file.clone()))).unwrap().len(), expected);
        }
    }

    #[test]
    fn without_a_file_the_endpoints_say_it_all() {
        let with = |listen: &[&str], connect: &[&str]| {
            let owned = |endpoints: &[&str]| endpoints.iter().map(|&endpoint| endpoint.to_owned()).collect();
            to_zenoh(&ServerEndpoints { listen: owned(listen), connect: owned(connect), ..ServerEndpoints::default() })
                .unwrap()
        };
        assert_eq!(json(&with(&["tcp/127.0.0.1:1"], &[]), "mode"), "\"router\"");
        let client = with(&[], &["tcp/127.0.0.1:1"]);
        assert_eq!(
            (json(&client, "mode"), json(&client, "listen/endpoints")),
            ("\"client\"".to_owned(), "[]".to_owned())
        );
    }
}
