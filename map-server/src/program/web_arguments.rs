//! The flags for the operators' page, and its section of the configuration file.

use fht_proto::RobotName;
use fht_web::{DoorCertificates, WebConfig};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::net::SocketAddr;
use std::path::PathBuf;

/// A page for operators in the browser, and the same questions over HTTP.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The page for operators")]
pub(super) struct WebArgs {
    /// Serve the page here, such as 127.0.0.1:8080. An address that other machines reach needs
    /// certificates.
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = fht_program::flags::socket_address)]
    web: Option<SocketAddr>,
    /// Who changes maps from this machine, without a certificate; without it the page only shows
    /// them.
    #[arg(long, value_name = "NAME")]
    web_operator: Option<RobotName>,
    /// A name by which browsers reach the page, besides those in its certificate (repeatable).
    #[arg(long, value_name = "HOST")]
    web_name: Vec<String>,
    /// The page's certificate (PEM). Who comes shows one, too: its common name is ROLE:NAME.
    #[arg(long, value_name = "FILE", requires_all = ["web_key", "web_authority"])]
    web_certificate: Option<PathBuf>,
    /// The key of the page's certificate (PEM).
    #[arg(long, value_name = "FILE", requires = "web_certificate")]
    web_key: Option<PathBuf>,
    /// Who has signed the certificates of those who are let in (PEM).
    #[arg(long, value_name = "FILE", requires = "web_certificate")]
    web_authority: Option<PathBuf>,
}

/// The operators' page.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct WebSection {
    /// Where it is served (`--web`), such as `127.0.0.1:8080`. Default none: there is no page.
    address: Option<String>,
    /// Who changes maps from this machine, without a certificate (`--web-operator`). Default none.
    operator: Option<String>,
    /// Names by which browsers reach it, besides those in its certificate (`--web-name`). Default
    /// none.
    names: Vec<String>,
    /// Its certificate, PEM (`--web-certificate`). Default none.
    certificate: Option<PathBuf>,
    /// The certificate's key, PEM (`--web-key`). Default none.
    key: Option<PathBuf>,
    /// Who has signed the certificates of those who are let in, PEM (`--web-authority`). Default
    /// none.
    authority: Option<PathBuf>,
}

impl WebArgs {
    /// Whether any of them is given.
    pub(super) fn is_given(&self) -> bool {
        self.web.is_some() || self.first_given().is_some()
    }

    /// The first flag that is given, besides the page's address.
    fn first_given(&self) -> Option<&'static str> {
        let Self { web: _, web_operator, web_name, web_certificate, web_key, web_authority } = self;
        let flags = [
            ("--web-operator", web_operator.is_some()),
            ("--web-name", !web_name.is_empty()),
            ("--web-certificate", web_certificate.is_some()),
            ("--web-key", web_key.is_some()),
            ("--web-authority", web_authority.is_some()),
        ];
        flags.into_iter().find_map(|(flag, is_given)| is_given.then_some(flag))
    }

    /// These flags over what the file says; none: there is no page.
    ///
    /// # Errors
    /// A sentence, if the file's address or name is none, or files are missing.
    pub(super) fn over(&self, file: WebSection) -> Result<Option<WebConfig>, String> {
        let in_file = |what: &str, text: &str| format!("server.web.{what} in the configuration file: {text} is none");
        let parsed = file.address.map(|text| text.parse().map_err(|_| in_file("address", &text)));
        let Some(address) = self.web.or(parsed.transpose()?) else {
            let alone = |flag: &str| Err(format!("{flag} goes with --web ADDRESS:PORT: where the page is served"));
            return self.first_given().map_or(Ok(None), alone);
        };
        let operator = file.operator.map(|text| text.parse().map_err(|_| in_file("operator", &text))).transpose()?;
        let names = if self.web_name.is_empty() { file.names } else { self.web_name.clone() };
        let files = [
            self.web_certificate.clone().or(file.certificate),
            self.web_key.clone().or(file.key),
            self.web_authority.clone().or(file.authority),
        ];
        let tls = match files {
            [Some(certificate), Some(key), Some(authority)] => Some(DoorCertificates { certificate, key, authority }),
            [None, None, None] => None,
            _ => return Err("certificate, key and authority of the page go together".to_owned()),
        };
        let operator = self.web_operator.clone().or(operator);
        Ok(Some(WebConfig { names, operator, tls, ..WebConfig::at(address) }))
    }
}
