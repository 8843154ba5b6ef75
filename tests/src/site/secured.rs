//! The site with mutual TLS and access control: the files and the script of `deploy/`, with this
//! machine's paths and endpoints in them.

use crate::site::config::SiteConfig;
use crate::site::report::SiteError;
use map_server::access::{Roles, configuration, object};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Who has a certificate of the authority and is in no list.
pub(super) const STRANGERS: [&str; 2] = ["gone", "lost"];
/// The client that is in the list, and attacks.
pub(super) const TRAITOR: &str = "traitor";
/// Who looks at the results.
pub(super) const OPERATOR: &str = "desk";

/// Where the certificates and configurations of a site lie.
#[derive(Clone)]
pub(super) struct Credentials {
    folder: PathBuf,
}

/// A secured site and its lists.
pub(super) struct Secured {
    pub(super) credentials: Credentials,
    roles: Roles,
}

fn deploy(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy").join(file)
}

fn names(what: &str, count: usize) -> Vec<String> {
    (0..count).map(|index| format!("{what}-{index}")).collect()
}

impl Secured {
    /// Makes all certificates.
    pub(super) fn make(config: &SiteConfig) -> Result<Self, SiteError> {
        let roles = Roles {
            routers: names("router", config.routers),
            servers: names("maps", config.servers),
            explorers: std::iter::once("floor".to_owned()).chain(names("writer", config.writers)).collect(),
            clients: std::iter::once(TRAITOR.to_owned()).chain(names("reader", config.readers)).collect(),
            operators: vec![OPERATOR.to_owned()],
        };
        let site = Self { credentials: Credentials::in_folder(config.folder.clone()), roles };
        site.certificate(&["authority"])?;
        for router in &site.roles.routers {
            site.certificate(&["router", router, "127.0.0.1"])?;
        }
        let lists = [
            ("server", &site.roles.servers),
            ("explorer", &site.roles.explorers),
            ("client", &site.roles.clients),
            ("operator", &site.roles.operators),
        ];
        for (role, names) in lists {
            for name in names {
                site.certificate(&[role, name])?;
            }
        }
        for name in STRANGERS {
            site.certificate(&["explorer", name])?;
        }
        std::fs::write(site.roles_file(), serde_json::to_string(&roles_of(&site.roles)).map_err(late)?)?;
        Ok(site)
    }

    fn certificate(&self, args: &[&str]) -> Result<(), SiteError> {
        let script = deploy("make-certificates.sh");
        let made =
            Command::new("sh").arg(script).arg("--out").arg(self.credentials.certificates()).args(args).output()?;
        match made.status.success() {
            true => Ok(()),
            false => Err(SiteError::Late(String::from_utf8_lossy(&made.stderr).into_owned())),
        }
    }

    /// The list for `map-server --roles`.
    pub(super) fn roles_file(&self) -> PathBuf {
        self.credentials.folder.join("roles.json5")
    }

    /// The configuration of the router at `index`, with `plugins` for its storages.
    pub(super) fn router(&self, index: usize, listen: &str, plugins: Value) -> Result<PathBuf, SiteError> {
        let name = &self.roles.routers[index];
        let mut config = self.credentials.shipped("router.json5", &format!("router-{name}"), &[listen], &[])?;
        config["plugins"] = plugins;
        let text = object(&config.to_string()).and_then(|config| configuration(config, &self.roles, Some(name)));
        self.credentials.file(&format!("zenohd-{name}"), &text.map_err(late)?)
    }
}

impl Credentials {
    pub(super) fn in_folder(folder: PathBuf) -> Self {
        Self { folder }
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn certificates(&self) -> PathBuf {
        self.folder.join("tls")
    }

    /// A file of `deploy/` for whoever has the certificate `own` (ROLE-NAME).
    fn shipped(&self, file: &str, own: &str, listen: &[&str], connect: &[String]) -> Result<Value, SiteError> {
        let tls = |name: &str| self.certificates().join(name).display().to_string();
        let text = std::fs::read_to_string(deploy(file))?
            .replace("/etc/fht-map/tls/own", &tls(own))
            .replace("/etc/fht-map/tls/ca.pem", &tls("ca.pem"));
        let mut config: Value = json5::from_str(&text).map_err(late)?;
        for (section, endpoints) in [("listen", Value::from(listen)), ("connect", Value::from(connect))] {
            if !endpoints.as_array().is_none_or(Vec::is_empty) {
                config[section]["endpoints"] = endpoints;
            }
        }
        Ok(config)
    }

    /// The configuration of a member, or a stranger, that connects to `endpoints`.
    pub(super) fn session(&self, role: &str, name: &str, endpoints: &[String]) -> Result<PathBuf, SiteError> {
        let config = self.shipped(&format!("{role}.json5"), &format!("{role}-{name}"), &[], endpoints)?;
        self.file(&format!("{role}-{name}"), &config.to_string())
    }

    fn file(&self, name: &str, text: &str) -> Result<PathBuf, SiteError> {
        let file = self.folder.join(format!("{name}.json5"));
        std::fs::write(&file, text)?;
        Ok(file)
    }

    /// Certificate, key and authority of a stranger.
    pub(super) fn stranger_tls(&self, name: &str) -> [PathBuf; 3] {
        let file = |end: &str| self.certificates().join(format!("explorer-{name}.{end}"));
        [file("pem"), file("key"), self.certificates().join("ca.pem")]
    }
}

fn roles_of(roles: &Roles) -> Value {
    serde_json::json!({
        "routers": roles.routers, "servers": roles.servers, "explorers": roles.explorers,
        "clients": roles.clients, "operators": roles.operators,
    })
}

fn late(error: impl std::fmt::Display) -> SiteError {
    SiteError::Late(error.to_string())
}
