//! Whether the certificates and keys that a configuration names can be read. Zenoh reads them at
//! each attempt to connect and would retry for ever with a missing file.

use std::path::{Path, PathBuf};
use zenoh::Config;

/// Why a certificate or key is of no use.
#[derive(Debug, thiserror::Error)]
pub enum CredentialError {
    /// The file cannot be read.
    #[error("transport.link.tls.{option}: {} cannot be read: {source}", file.display())]
    Unreadable {
        /// Which option names it.
        option: &'static str,
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is something else.
    #[error("transport.link.tls.{option}: {} holds no {expected} in PEM form", file.display())]
    NotPem {
        /// Which option names it.
        option: &'static str,
        /// The file.
        file: PathBuf,
        /// What it should hold.
        expected: &'static str,
    },
    /// Mutual TLS is asked for, but half of it is not there.
    #[error("transport.link.tls.enable_mtls is set, but {option} is not: the robot has no certificate to show")]
    Missing {
        /// Which option is not set.
        option: &'static str,
    },
}

/// The options of `transport.link.tls` that a connecting session uses, each with what its file
/// holds.
const FILES: [(&str, &str); 3] = [
    ("root_ca_certificate", "CERTIFICATE"),
    ("connect_certificate", "CERTIFICATE"),
    ("connect_private_key", "PRIVATE KEY"),
];

/// Checks what `config` says of TLS, if one of `endpoints` needs it. Inline certificates
/// (`…_base64`) are left to Zenoh.
///
/// # Errors
/// The first thing that is wrong.
pub fn check(config: &Config, endpoints: &[String]) -> Result<(), CredentialError> {
    if !endpoints.iter().any(|endpoint| endpoint.starts_with("tls/") || endpoint.starts_with("quic/")) {
        return Ok(());
    }
    let json = config.get_json("transport/link/tls").unwrap_or_default();
    let tls: serde_json::Value = serde_json::from_str(&json).unwrap_or_default();
    let is_mutual = tls.get("enable_mtls").and_then(serde_json::Value::as_bool).unwrap_or(false);
    for (option, expected) in FILES {
        match tls.get(option).and_then(serde_json::Value::as_str) {
            Some(file) => check_file(option, Path::new(file), expected)?,
            None if is_mutual
                && option != "root_ca_certificate"
                && tls.get(format!("{option}_base64")).is_none_or(serde_json::Value::is_null) =>
            {
                return Err(CredentialError::Missing { option });
            }
            None => {}
        }
    }
    Ok(())
}

fn check_file(option: &'static str, file: &Path, expected: &'static str) -> Result<(), CredentialError> {
    let text =
        std::fs::read(file).map_err(|source| CredentialError::Unreadable { option, file: file.to_owned(), source })?;
    let text = String::from_utf8_lossy(&text);
    // `BEGIN EC PRIVATE KEY` is one, too.
    let is_there = text.lines().any(|line| line.starts_with("-----BEGIN ") && line.contains(expected));
    if is_there { Ok(()) } else { Err(CredentialError::NotPem { option, file: file.to_owned(), expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thing_that_is_wrong_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let file = dir.path().join(name);
            std::fs::write(&file, text).unwrap();
            file.to_str().unwrap().to_owned()
        };
        let certificate = write("robot.pem", "-----BEGIN CERTIFICATE-----\n");
        let key = write("robot.key", "-----BEGIN EC PRIVATE KEY-----\n");
        let said = |tls: &str, endpoint: &str| {
            let mut config = Config::default();
            config.insert_json5("transport/link/tls", tls).unwrap();
            check(&config, &[endpoint.to_owned()]).err().map(|error| error.to_string()).unwrap_or_default()
        };
        let whole = format!(
            "{{enable_mtls: true, root_ca_certificate: {certificate:?}, connect_certificate: {certificate:?}, connect_private_key: {key:?}}}"
        );
        assert_eq!(said(&whole, "tls/hall:7447"), "");
        let missing = said(&whole.replace("robot.key", "gone.key"), "tls/hall:7447");
        assert!(missing.contains("connect_private_key") && missing.contains("gone.key cannot be read"), "{missing}");
        let swapped = said(&whole.replace("robot.key", "robot.pem"), "tls/hall:7447");
        assert!(swapped.contains("holds no PRIVATE KEY"), "{swapped}");
        let without = said(&format!("{{enable_mtls: true, root_ca_certificate: {certificate:?}}}"), "tls/hall:7447");
        assert!(without.contains("connect_certificate is not"), "{without}");
        assert_eq!(said("{root_ca_certificate: \"gone.pem\"}", "tcp/hall:7447"), "", "not needed");
    }
}
