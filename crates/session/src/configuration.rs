//! Zenoh's configuration as people give it: a file, and endpoints that go before what it says.

use crate::trouble;
use std::path::{Path, PathBuf};
use zenoh::Config;
use zenoh::config::EndPoint;

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
    let is_host_and_port =
        |text: &str| text.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
    let text = if !given.contains('/') && is_host_and_port(given) { format!("tcp/{given}") } else { given.to_owned() };
    // Zenoh finds out later that there is no port, and says so in a way that few understand.
    let has_port = |rest: &str| is_host_and_port(rest.split(['?', '#']).next().unwrap_or(rest));
    let is_whole = text.split_once('/').is_some_and(|(protocol, rest)| match protocol {
        "tcp" | "tls" => has_port(rest),
        protocol => protocol == "unixsock-stream",
    });
    if is_whole && text.parse::<EndPoint>().is_ok() {
        return Ok(text);
    }
    Err(ConfigurationError::Endpoint { given: given.to_owned() })
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
            "hall:70000",
            "tcp/",
            "/hall:7447",
            "tcp/hall",
            "http://hall:80",
        ] {
            let error = endpoint(bad).unwrap_err().to_string();
            assert!(error.starts_with(&format!("'{bad}' is not an endpoint: write HOST:PORT")), "{error}");
        }
    }
}
