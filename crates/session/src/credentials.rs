//! Whether the certificates and keys that a configuration names can be read, and are this robot's.
//! Zenoh reads them at each attempt to connect and would retry for ever with a missing file.

use rustls::crypto::ring::sign::any_supported_type;
use rustls::pki_types::PrivateKeyDer;
use rustls::pki_types::pem::PemObject;
use std::path::{Path, PathBuf};
use std::time::Duration;
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
         be let write: start it with {}a certificate of its own",
        file.display(), named_so(role, owner)
    )]
    OtherName {
        /// The certificate.
        file: PathBuf,
        /// Whom it names: `ROLE:NAME`.
        common_name: String,
        /// The name in it.
        owner: String,
        /// What the program is: `explorer`, `client` or `operator`.
        role: &'static str,
        /// What it is called.
        name: String,
    },
    /// The certificate's role is not the program's.
    #[error(
        "transport.link.tls.connect_certificate: {} is of {common_name}, which may not {}",
        file.display(), what_it_takes(role)
    )]
    OtherRole {
        /// The certificate.
        file: PathBuf,
        /// Whom it names: `ROLE:NAME`.
        common_name: String,
        /// What the program is: `explorer`, `operator`, `server` or `serving robot`.
        role: &'static str,
    },
    /// The key is not the certificate's.
    #[error(
        "transport.link.tls.{option}: {} is not the key of the certificate {}", key.display(), certificate.display()
    )]
    NotItsKey {
        /// Which option names the key.
        option: &'static str,
        /// The certificate.
        certificate: PathBuf,
        /// The key.
        key: PathBuf,
    },
    /// The certificate is made to connect with, and not to listen.
    #[error(
        "transport.link.tls.listen_certificate: {} is made to connect with, and nobody takes it from who listens: make \
         one with the names of this host", file.display()
    )]
    NotToListen {
        /// The certificate.
        file: PathBuf,
    },
    /// An endpoint needs a protocol that the configuration does not allow.
    #[error(
        "{endpoint} needs the protocol {protocol}, and transport.link.protocols allows {allowed:?} alone: change one of \
         the two"
    )]
    Protocol {
        /// The endpoint.
        endpoint: String,
        /// What it begins with.
        protocol: String,
        /// What is allowed.
        allowed: Vec<String>,
    },
    /// TLS is asked for, but half of it is not there.
    #[error("transport.link.tls.{option} is not set: {}", lack(option))]
    Missing {
        /// Which option is not set.
        option: &'static str,
    },
}

/// What only those of a role may do, and what that takes.
fn what_it_takes(role: &str) -> &'static str {
    match role {
        "explorer" => "write maps: that takes a certificate of an explorer",
        "server" => "serve maps: that takes a certificate of a server",
        "serving robot" => "take goals: that takes a certificate of a client or an explorer",
        _ => "give orders or change maps: that takes a certificate of an operator",
    }
}

/// What is lacking without an option.
fn lack(option: &str) -> &'static str {
    match option {
        "root_ca_certificate" => "with enable_mtls, it says whose certificates are let in",
        "listen_certificate" | "listen_private_key" => "who listens with TLS shows a certificate",
        _ => "with enable_mtls, a certificate has to be shown",
    }
}

/// The flag by which a program of this role is called what the certificate says, if that can be a
/// name of a robot or operator.
fn named_so(role: &str, owner: &str) -> String {
    let flag = if role == "operator" { "operator" } else { "robot" };
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == '-';
    let is_name = (1..=64).contains(&owner.len()) && owner.chars().all(is_plain);
    if is_name { format!("--{flag} {owner}, or with ") } else { String::new() }
}

/// What a session does over TLS, and with it the options of `transport.link.tls` that it uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TlsSide {
    /// It connects.
    Connecting,
    /// It listens.
    Listening,
}

impl TlsSide {
    fn certificate(self) -> &'static str {
        if self == Self::Connecting { "connect_certificate" } else { "listen_certificate" }
    }

    fn key(self) -> &'static str {
        if self == Self::Connecting { "connect_private_key" } else { "listen_private_key" }
    }

    /// The options, each with what its file holds.
    fn files(self) -> [(&'static str, &'static str); 3] {
        [("root_ca_certificate", "CERTIFICATE"), (self.certificate(), "CERTIFICATE"), (self.key(), "PRIVATE KEY")]
    }
}

fn needs_tls(endpoints: &[String]) -> bool {
    endpoints.iter().any(|endpoint| endpoint.starts_with("tls/") || endpoint.starts_with("quic/"))
}

/// Checks what `config` says of TLS for one side, if one of its `endpoints` needs it. Inline
/// certificates (`…_base64`) are left to Zenoh.
///
/// # Errors
/// The first thing that is wrong.
pub fn check(config: &Config, endpoints: &[String], side: TlsSide) -> Result<(), CredentialError> {
    check_protocols(config, endpoints)?;
    if !needs_tls(endpoints) {
        return Ok(());
    }
    let tls = tls_options(config);
    let is_mutual = tls.get("enable_mtls").and_then(serde_json::Value::as_bool).unwrap_or(false);
    // Who listens shows a certificate in any case; who connects is checked against the authority
    // only if the system's own are not enough.
    let is_needed = |option: &str| match side {
        TlsSide::Connecting => is_mutual && option != "root_ca_certificate",
        TlsSide::Listening => is_mutual || option != "root_ca_certificate",
    };
    for (option, expected) in side.files() {
        match tls.get(option).and_then(serde_json::Value::as_str) {
            Some(file) => check_file(option, Path::new(file), expected)?,
            None if is_needed(option) && tls.get(format!("{option}_base64")).is_none_or(serde_json::Value::is_null) => {
                return Err(CredentialError::Missing { option });
            }
            None => {}
        }
    }
    let file = |option: &str| tls.get(option).and_then(serde_json::Value::as_str).map(Path::new);
    if let Some(certificate) = file(side.certificate()).filter(|file| side == TlsSide::Listening && !may_listen(file)) {
        return Err(CredentialError::NotToListen { file: certificate.to_owned() });
    }
    match file(side.certificate()).zip(file(side.key())) {
        Some((certificate, key)) if !is_key_of(certificate, key).unwrap_or(true) => {
            let (certificate, key) = (certificate.to_owned(), key.to_owned());
            Err(CredentialError::NotItsKey { option: side.key(), certificate, key })
        }
        _ => Ok(()),
    }
}

/// That the certificate which is shown is out of date, a sentence. It is no error: it may be
/// renewed while the program waits, or the clock set.
pub fn out_of_date(config: &Config, endpoints: &[String], side: TlsSide) -> Option<String> {
    let option = side.certificate();
    let (file, pem) = shown(config, endpoints, side)?;
    let certificate = pem.parse_x509().ok()?;
    let validity = certificate.validity();
    (!validity.is_valid()).then(|| {
        format!(
            "transport.link.tls.{option}: {file} is valid from {} to {}, and by this machine's clock that is not now: nobody \
             takes it",
            validity.not_before, validity.not_after
        )
    })
}

/// For how long a certificate is valid; in words, that it expires.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Validity {
    /// Which, and to when, a sentence without its end.
    pub said: String,
    /// In all.
    pub of: Duration,
    /// From now on.
    pub left: Duration,
}

/// For how long the certificate which is shown is valid; none: there is none, or it is out of date.
pub fn valid_for(config: &Config, endpoints: &[String], side: TlsSide) -> Option<Validity> {
    let option = side.certificate();
    let (file, pem) = shown(config, endpoints, side)?;
    let certificate = pem.parse_x509().ok()?;
    let validity = certificate.validity();
    Some(Validity {
        said: format!("transport.link.tls.{option}: {file} expires on {}", validity.not_after),
        of: (validity.not_after - validity.not_before)?.try_into().ok()?,
        left: validity.time_to_expiration()?.try_into().ok()?,
    })
}

/// The certificate which is shown, and its file, if a side of TLS is needed.
fn shown(config: &Config, endpoints: &[String], side: TlsSide) -> Option<(String, Pem)> {
    let tls = tls_options(config);
    let file = tls.get(side.certificate()).and_then(serde_json::Value::as_str).filter(|_| needs_tls(endpoints))?;
    Some((file.to_owned(), first_certificate(Path::new(file))?))
}

/// Zenoh would try an endpoint whose protocol is switched off for ever.
fn check_protocols(config: &Config, endpoints: &[String]) -> Result<(), CredentialError> {
    let json = config.get_json("transport/link/protocols").unwrap_or_default();
    let Ok(Some(allowed)) = serde_json::from_str::<Option<Vec<String>>>(&json) else { return Ok(()) };
    let protocol_of = |endpoint: &str| endpoint.split_once('/').map(|(protocol, _)| protocol.to_owned());
    let is_off = |endpoint: &&String| protocol_of(endpoint).is_some_and(|protocol| !allowed.contains(&protocol));
    match endpoints.iter().find(is_off) {
        Some(endpoint) => {
            let protocol = protocol_of(endpoint).unwrap_or_default();
            Err(CredentialError::Protocol { endpoint: endpoint.clone(), protocol, allowed })
        }
        None => Ok(()),
    }
}

/// Whether a certificate may be shown by who listens; what cannot be read may.
fn may_listen(certificate: &Path) -> bool {
    let Some(pem) = first_certificate(certificate) else { return true };
    let usage = pem.parse_x509().ok().and_then(|certificate| {
        let usage = certificate.extended_key_usage().ok()??;
        Some(usage.value.server_auth || usage.value.any)
    });
    usage.unwrap_or(true)
}

/// Whether a key is a certificate's. None: one of the two is of a sort that is not known here.
fn is_key_of(certificate: &Path, key: &Path) -> Option<bool> {
    let key = any_supported_type(&PrivateKeyDer::from_pem_file(key).ok()?).ok()?;
    let public_key = key.public_key()?;
    let pem = first_certificate(certificate)?;
    let certificate = pem.parse_x509().ok()?;
    Some(certificate.public_key().raw == public_key.as_ref())
}

fn tls_options(config: &Config) -> serde_json::Value {
    let json = config.get_json("transport/link/tls").unwrap_or_default();
    serde_json::from_str(&json).unwrap_or_default()
}

/// Checks that the certificate which a robot shows over TLS is its own: of its common name
/// `ROLE:NAME` the name must be `name`. An explorer's must not be a client's, and an operator's no
/// robot's. What cannot be read is left to [`check`], and other common names to the routers.
///
/// # Errors
/// [`CredentialError::OtherName`], [`CredentialError::OtherRole`].
pub fn check_owner(
    config: &Config,
    endpoints: &[String],
    role: &'static str,
    name: &str,
) -> Result<(), CredentialError> {
    let Some((file, pem)) = shown(config, endpoints, TlsSide::Connecting) else { return Ok(()) };
    let Some(common_name) = common_name(&pem) else { return Ok(()) };
    let file = PathBuf::from(file);
    match (role, common_name.split_once(':')) {
        ("explorer", Some(("client", _))) | ("operator", Some(("client" | "explorer", _))) => {
            Err(CredentialError::OtherRole { file, common_name, role })
        }
        // Whatever its role, it lets its owner report and nobody else.
        (_, Some(("client" | "explorer" | "operator", owner))) if owner != name => {
            let (owner, name) = (owner.to_owned(), name.to_owned());
            Err(CredentialError::OtherName { file, owner, role, name, common_name })
        }
        _ => Ok(()),
    }
}

/// Checks that the certificate which a robot shows that takes goals is not an operator's: routers
/// would let it answer nobody.
///
/// # Errors
/// [`CredentialError::OtherRole`].
pub fn check_serving(config: &Config, endpoints: &[String]) -> Result<(), CredentialError> {
    is_none_of(config, endpoints, "serving robot", &["operator"])
}

/// Checks that the certificate which a map-server shows to routers over TLS is not a robot's or an
/// operator's: these would let it answer nobody. Other common names are left to the routers.
///
/// # Errors
/// [`CredentialError::OtherRole`].
pub fn check_server(config: &Config, endpoints: &[String]) -> Result<(), CredentialError> {
    is_none_of(config, endpoints, "server", &["client", "explorer", "operator"])
}

/// Checks that the certificate which is shown is not of one of `others`: not for what a `role`
/// does.
fn is_none_of(
    config: &Config,
    endpoints: &[String],
    role: &'static str,
    others: &[&str],
) -> Result<(), CredentialError> {
    let Some((file, pem)) = shown(config, endpoints, TlsSide::Connecting) else { return Ok(()) };
    match common_name(&pem) {
        Some(common_name) if common_name.split_once(':').is_some_and(|(of, _)| others.contains(&of)) => {
            Err(CredentialError::OtherRole { file: file.into(), common_name, role })
        }
        _ => Ok(()),
    }
}

/// The name in the certificate that a map-server shows, if it is a server's.
pub fn server_name(config: &Config, endpoints: &[String]) -> Option<String> {
    let (_, pem) = shown(config, endpoints, TlsSide::Connecting)?;
    Some(common_name(&pem)?.strip_prefix("server:")?.to_owned())
}

/// The common name in a certificate, if there is one.
fn common_name(pem: &Pem) -> Option<String> {
    let certificate = pem.parse_x509().ok()?;
    let name = certificate.subject().iter_common_name().next()?;
    name.as_str().ok().map(str::to_owned)
}

fn first_certificate(file: &Path) -> Option<Pem> {
    let text = std::fs::read(file).ok()?;
    Pem::iter_from_buffer(&text).filter_map(Result::ok).find(|pem| pem.label == "CERTIFICATE")
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
            check(&config, &[endpoint.to_owned()], TlsSide::Connecting)
                .err()
                .map(|error| error.to_string())
                .unwrap_or_default()
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
        assert!(without.contains("connect_certificate is not set"), "{without}");
        assert_eq!(said("{root_ca_certificate: \"gone.pem\"}", "tcp/hall:7447"), "", "not needed");
    }

    #[test]
    fn who_listens_needs_a_certificate_and_its_key() {
        let said = |tls: &str| {
            let mut config = Config::default();
            config.insert_json5("transport/link/tls", tls).unwrap();
            let listen = ["tls/0.0.0.0:7447".to_owned()];
            check(&config, &listen, TlsSide::Listening).err().map(|error| error.to_string()).unwrap_or_default()
        };
        let none = said("{}");
        assert!(none.contains("listen_certificate is not set"), "{none}");
        let gone = said(r#"{listen_certificate: "gone.pem", listen_private_key: "gone.key"}"#);
        assert!(gone.contains("listen_certificate: gone.pem cannot be read"), "{gone}");
        let nobody = said("{enable_mtls: true}");
        assert!(nobody.contains("root_ca_certificate is not set"), "{nobody}");
    }

    #[test]
    fn only_a_name_is_proposed_as_one() {
        assert_eq!(named_so("operator", "desk"), "--operator desk, or with ");
        assert_eq!(named_so("explorer", "amr-7"), "--robot amr-7, or with ");
        for none in ["", " desk", "desk,client:tug", &"x".repeat(65)] {
            assert_eq!(named_so("operator", none), "");
        }
    }

    #[test]
    fn an_endpoint_whose_protocol_is_switched_off_is_named() {
        let mut config = Config::default();
        let hall = ["tcp/hall:7447".to_owned()];
        assert!(check(&config, &hall, TlsSide::Connecting).is_ok());
        config.insert_json5("transport/link/protocols", r#"["tls"]"#).unwrap();
        let told = check(&config, &hall, TlsSide::Connecting).unwrap_err().to_string();
        assert!(told.starts_with("tcp/hall:7447 needs the protocol tcp"), "{told}");
    }

    #[test]
    fn a_certificate_that_has_expired_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
        let openssl = |args: &[&str]| {
            let made = std::process::Command::new("openssl").args(args).output().unwrap();
            assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        };
        let told = |file: &str| {
            let mut config = Config::default();
            config.insert_json5("transport/link/tls", &format!("{{listen_certificate: {:?}}}", at(file))).unwrap();
            out_of_date(&config, &["tls/0.0.0.0:7447".to_owned()], TlsSide::Listening)
        };
        let subject = ["-days", "2", "-subj", "/CN=router:a", "-keyout", &at("a.key"), "-out", &at("a.pem")];
        openssl(&[&["req", "-x509", "-newkey", "rsa:2048", "-nodes"], &subject[..]].concat());
        assert_eq!(told("a.pem"), None);
        let mut config = Config::default();
        config.insert_json5("transport/link/tls", &format!("{{connect_certificate: {:?}}}", at("a.pem"))).unwrap();
        let left_for = |endpoint: &str| valid_for(&config, &[endpoint.to_owned()], TlsSide::Connecting);
        let (day, left) = (Duration::from_secs(86_400), left_for("tls/hall:7447").unwrap());
        assert!(left.left > day && left.left <= 2 * day && left.of == 2 * day, "{left:?}");
        let (says, file) = (&left.said, at("a.pem"));
        assert!(says.starts_with(&format!("transport.link.tls.connect_certificate: {file} expires on ")), "{says}");
        assert_eq!(left_for("tcp/hall:7447"), None);
        openssl(&["x509", "-in", &at("a.pem"), "-signkey", &at("a.key"), "-days", "0", "-out", &at("old.pem")]);
        std::thread::sleep(std::time::Duration::from_millis(2100)); // it was valid for that second
        let sentence = told("old.pem").unwrap();
        assert!(sentence.contains("old.pem is valid from") && sentence.contains("that is not now"), "{sentence}");
    }
}
