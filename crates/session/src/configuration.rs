//! Zenoh's configuration as people give it: a file, and endpoints that go before what it says.

use crate::trouble;
use std::net::Ipv6Addr;
use std::path::{Path, PathBuf};
use zenoh::Config;
use zenoh::config::EndPoint;

/// The protocols that are built in: those of `zenoh` in the workspace's `Cargo.toml`.
const PROTOCOLS: [&str; 3] = ["tcp", "tls", "unixsock-stream"];

/// Why what was given is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationError {
    /// The file cannot be read or is not understood.
    #[error("the Zenoh configuration {} is not accepted: {reason}", file.display())]
    File {
        /// Which.
        file: PathBuf,
        /// What Zenoh says.
        reason: String,
    },
    /// A text that is no endpoint.
    #[error("'{given}' is not an endpoint: write HOST:PORT, or PROTOCOL/HOST:PORT such as tls/maps.example.com:7447")]
    Endpoint {
        /// What was given.
        given: String,
    },
    /// A protocol that the programs do not speak.
    #[error("'{given}': {protocol} is none of the protocols that there are: {}", PROTOCOLS.join(", "))]
    Protocol {
        /// What was given.
        given: String,
        /// The protocol in it.
        protocol: String,
    },
    /// A port beyond the last one.
    #[error("'{given}': there is no port {port}; ports go up to {}", u16::MAX)]
    Port {
        /// What was given.
        given: String,
        /// The port in it.
        port: String,
    },
    /// What Zenoh refuses.
    #[error("Zenoh does not accept {value} as {key}: {reason}")]
    Refused {
        /// The option.
        key: &'static str,
        /// Its value.
        value: String,
        /// What Zenoh says.
        reason: String,
    },
}

/// How long a full link is waited for, microseconds: Zenoh's own default, 1 ms, loses answers and
/// pictures on a busy machine, whose threads wait longer for their turn. A link that was too slow
/// once is not waited for again until it takes something.
pub const WAIT_BEFORE_DROP: (&str, &str) =
    ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "10000");

/// What `file` says, Zenoh's defaults without one.
///
/// # Errors
/// [`ConfigurationError::File`].
pub fn read_config(file: Option<&Path>) -> Result<Config, ConfigurationError> {
    let Some(file) = file else { return Ok(Config::default()) };
    Config::from_file(file)
        .map_err(|error| ConfigurationError::File { file: file.to_owned(), reason: plain(&trouble::in_words(&error)) })
}

/// What Zenoh says of a file that it cannot read, without the marks of a debug text:
/// `JSON error: Message { msg: "…", location: Some(Location { line: 6, column: 3 }) }`.
fn plain(reason: &str) -> String {
    let told = || {
        let (_, rest) = reason.split_once("Message { msg: \"")?;
        let (message, rest) = rest.split_once("\", location: ")?;
        let number = |name: &str| {
            let (_, rest) = rest.split_once(name)?;
            rest.split(|letter: char| !letter.is_ascii_digit()).next().filter(|digits| !digits.is_empty())
        };
        let place = number("line: ").zip(number("column: "));
        let place = place.map(|(line, column)| format!("line {line}, column {column}: ")).unwrap_or_default();
        Some(format!("{place}{}", message.replace("\\\"", "\"")))
    };
    told().unwrap_or_else(|| reason.to_owned())
}

/// Sets a list of endpoints (`connect/endpoints`, `listen/endpoints`). `HOST:PORT` is
/// `tcp/HOST:PORT`.
///
/// # Errors
/// The first one that is no endpoint.
pub fn set_endpoints(config: &mut Config, key: &'static str, given: &[String]) -> Result<(), ConfigurationError> {
    let endpoints: Vec<String> = given.iter().map(|given| endpoint(given)).collect::<Result<_, _>>()?;
    let value = serde_json::Value::from(endpoints).to_string();
    set(config, key, &value)
}

/// Sets what nobody has set.
///
/// # Errors
/// When Zenoh does not know the key, or refuses the value.
pub fn set_default(config: &mut Config, key: &'static str, value: &str) -> Result<(), ConfigurationError> {
    let is_set = config.get_json(key).ok() != Config::default().get_json(key).ok();
    if is_set { Ok(()) } else { set(config, key, value) }
}

/// Sets an option, whatever it was.
///
/// # Errors
/// When Zenoh does not know the key, or refuses the value.
pub fn set(config: &mut Config, key: &'static str, value: &str) -> Result<(), ConfigurationError> {
    config.insert_json5(key, value).map_err(|error| ConfigurationError::Refused {
        key,
        value: value.to_owned(),
        reason: trouble::in_words(&error),
    })
}

fn endpoint(given: &str) -> Result<String, ConfigurationError> {
    let wrong = || ConfigurationError::Endpoint { given: given.to_owned() };
    let (protocol, address) = given.split_once('/').unwrap_or(("tcp", given));
    let is_word = |text: &str| !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '-');
    if !is_word(protocol) {
        return Err(wrong());
    }
    if !PROTOCOLS.contains(&protocol) {
        return Err(ConfigurationError::Protocol { given: given.to_owned(), protocol: protocol.to_owned() });
    }
    if protocol != "unixsock-stream" {
        check_host_and_port(given, address)?;
    }
    let text = format!("{protocol}/{address}");
    if text.parse::<EndPoint>().is_ok() { Ok(text) } else { Err(wrong()) }
}

/// Zenoh finds out later what is wrong with an address, and says so in a way that few understand.
fn check_host_and_port(given: &str, address: &str) -> Result<(), ConfigurationError> {
    let place = address.split(['?', '#']).next().unwrap_or(address);
    let Some((_, port)) = place.rsplit_once(':').filter(|(host, _)| is_host(host)) else {
        return Err(ConfigurationError::Endpoint { given: given.to_owned() });
    };
    if port.parse::<u16>().is_ok() {
        return Ok(());
    }
    let is_number = !port.is_empty() && port.chars().all(|digit| digit.is_ascii_digit());
    Err(if is_number {
        ConfigurationError::Port { given: given.to_owned(), port: port.to_owned() }
    } else {
        ConfigurationError::Endpoint { given: given.to_owned() }
    })
}

/// Whether this may be a name or an address. Colons are of IPv6 alone: `tcp:hall` is misspelt.
fn is_host(text: &str) -> bool {
    let bare = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(text);
    // Behind a percent sign stands an interface.
    let is_v6 = || bare.split('%').next().unwrap_or(bare).parse::<Ipv6Addr>().is_ok();
    !text.is_empty() && !text.contains('/') && (!text.contains(':') || is_v6())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_with_a_file_is_said_without_marks() {
        let marked = "JSON error: Message { msg: \"unknown field `routers`, not \\\"a\\\"\", \
            location: Some(Location { line: 6, column: 3 }) }";
        assert_eq!(plain(marked), "line 6, column 3: unknown field `routers`, not \"a\"");
        let nowhere = r#"Message { msg: "empty", location: None }"#;
        assert_eq!((plain(nowhere).as_str(), plain("No such file").as_str()), ("empty", "No such file"));
    }

    #[test]
    fn a_host_and_a_port_are_enough() {
        for (given, expected) in [
            ("127.0.0.1:7447", "tcp/127.0.0.1:7447"),
            ("maps.example.com:7447", "tcp/maps.example.com:7447"),
            ("[::1]:7447", "tcp/[::1]:7447"),
            ("tls/[fe80::1%eth0]:7447", "tls/[fe80::1%eth0]:7447"),
            ("tls/hall:7447", "tls/hall:7447"),
            ("tcp/hall:7447#iface=eth0", "tcp/hall:7447#iface=eth0"),
            ("unixsock-stream//run/fht-map", "unixsock-stream//run/fht-map"),
        ] {
            assert_eq!(endpoint(given).unwrap(), expected);
        }
        for bad in [
            "",
            "127.0.0.1",
            "hall",
            ":7447",
            "hall:http",
            "tcp/",
            "/hall:7447",
            "tcp/hall",
            "tcp/hall:",
            "tcp:hall:7447",
            "tcp/tcp:127.0.0.1:7447",
            "tcp://hall:7447",
            "http://hall:80",
        ] {
            let error = endpoint(bad).unwrap_err().to_string();
            assert!(error.starts_with(&format!("'{bad}' is not an endpoint: write HOST:PORT")), "{error}");
        }
    }

    #[test]
    fn what_is_wrong_with_an_endpoint_of_the_right_form_is_named() {
        for protocol in ["udp", "quic", "ws", "TCP"] {
            let given = format!("{protocol}/127.0.0.1:7447");
            let said = endpoint(&given).unwrap_err().to_string();
            let expected =
                format!("'{given}': {protocol} is none of the protocols that there are: tcp, tls, unixsock-stream");
            assert_eq!(said, expected);
        }
        for (given, port) in
            [("tcp/127.0.0.1:99999", "99999"), ("hall:70000", "70000"), ("tls/hall:65536#a=b", "65536")]
        {
            let said = endpoint(given).unwrap_err().to_string();
            assert_eq!(said, format!("'{given}': there is no port {port}; ports go up to 65535"));
        }
        assert_eq!(endpoint("hall:65535").unwrap(), "tcp/hall:65535");
    }
}
