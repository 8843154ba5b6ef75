//! The names by which this side is reached: a name of a stranger that leads here is none of them.

use std::collections::BTreeSet;
use std::net::IpAddr;

/// The names by which this side is reached.
#[derive(Debug)]
pub struct Hosts {
    names: BTreeSet<String>,
    is_secure: bool,
}

impl Hosts {
    /// Listening at `address`; `names` are further ones.
    #[must_use]
    pub fn new(address: IpAddr, names: impl Iterator<Item = String>, is_secure: bool) -> Self {
        let own = match address {
            _ if address.is_unspecified() => None,
            IpAddr::V4(address) => Some(address.to_string()),
            IpAddr::V6(address) => Some(format!("[{address}]")),
        };
        let here = ["localhost", "127.0.0.1", "[::1]"].map(str::to_owned);
        let names = here.into_iter().chain(own).chain(names).map(|name| name.to_ascii_lowercase()).collect();
        Self { names, is_secure }
    }

    /// `http`, or `https` with certificates.
    #[must_use]
    pub fn scheme(&self) -> &'static str {
        if self.is_secure { "https" } else { "http" }
    }

    /// Whether an authority, `host` or `host:port`, is of this side.
    #[must_use]
    pub fn has(&self, authority: &str) -> bool {
        self.names.contains(&without_port(authority).to_ascii_lowercase())
    }
}

/// A host of `host:port`. The port may be another one than here: tunnels lead to this machine.
fn without_port(authority: &str) -> &str {
    match authority.rsplit_once(':') {
        Some((host, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => host,
        _ => authority,
    }
}
