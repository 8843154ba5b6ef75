//! Whether the certificates and keys that a configuration names can be read, and are this robot's.
//! Zenoh reads them at each attempt to connect and would retry for ever with a missing file.

use std::path::{Path, PathBuf};
use x509_parser::pem::Pem;
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
    /// The certificate is another robot's.
    #[error(
        "transport.link.tls.connect_certificate: {} is of {common_name}, but this {role} is called {name}, and would not \
         be let write: start it with --robot {owner}, or with a certificate of its own",
        file.display()
    )]
    OtherName {
        /// The certificate.
        file: PathBuf,
        /// Whom it names: `ROLE:NAME`.
        common_name: String,
        /// The name in it.
        owner: String,
        /// What the program is: `explorer` or `client`.
        role: &'static str,
        /// What it is called.
        name: String,
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

fn needs_tls(endpoints: &[String]) -> bool {
    endpoints.iter().any(|endpoint| endpoint.starts_with("tls/") || endpoint.starts_with("quic/"))
}

/// Checks what `config` says of TLS, if one of `endpoints` needs it. Inline certificates
/// (`…_base64`) are left to Zenoh.
///
/// # Errors
/// The first thing that is wrong.
pub fn check(config: &Config, endpoints: &[String]) -> Result<(), CredentialError> {
    if !needs_tls(endpoints) {
        return Ok(());
    }
    let tls = tls_options(config);
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

fn tls_options(config: &Config) -> serde_json::Value {
    let json = config.get_json("transport/link/tls").unwrap_or_default();
    serde_json::from_str(&json).unwrap_or_default()
}

/// Checks that the certificate which a robot shows over TLS does not carry another robot's name: a
/// common name of `ROLE:NAME` with this `role` and another name. What cannot be read is left to
/// [`check`], and other common names to the routers.
///
/// # Errors
/// [`CredentialError::OtherName`].
pub fn check_owner(
    config: &Config,
    endpoints: &[String],
    role: &'static str,
    name: &str,
) -> Result<(), CredentialError> {
    let tls = tls_options(config);
    let file = tls.get("connect_certificate").and_then(serde_json::Value::as_str).map(PathBuf::from);
    let Some(file) = file.filter(|_| needs_tls(endpoints)) else { return Ok(()) };
    let Some(common_name) = common_name(&file) else { return Ok(()) };
    match common_name.split_once(':') {
        Some((of, owner)) if of == role && owner != name => {
            let (owner, name) = (owner.to_owned(), name.to_owned());
            Err(CredentialError::OtherName { file, owner, role, name, common_name })
        }
        _ => Ok(()),
    }
}

/// The common name in the first certificate of a PEM file, if there is one.
fn common_name(file: &Path) -> Option<String> {
    let text = std::fs::read(file).ok()?;
    let pem = Pem::iter_from_buffer(&text).filter_map(Result::ok).find(|pem| pem.label == "CERTIFICATE")?;
    let certificate = pem.parse_x509().ok()?;
    let name = certificate.subject().iter_common_name().next()?;
    name.as_str().ok().map(str::to_owned)
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
