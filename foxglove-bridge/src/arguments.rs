//! The command line.

use clap::Parser;
use fht_door::DoorCertificates;
use fht_program::flags::{CompletionsArgs, ConnectArgs, new_file};
use fht_proto::MapName;
use std::net::SocketAddr;
use std::path::PathBuf;
use tokio_tungstenite::tungstenite::http::Uri;
use tokio_tungstenite::tungstenite::http::uri::Authority;

/// A map and its robots, live in Foxglove and Lichtblick.
#[derive(Debug, Parser)]
#[command(
    name = "foxglove-bridge",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    args_conflicts_with_subcommands = true,
    after_help = "Examples:
  foxglove-bridge --map museum                               open ws://127.0.0.1:8765 in Foxglove
  foxglove-bridge --map museum --connect tcp/server:7447
  foxglove-bridge --map museum --record museum.mcap          … and write what is shown
  foxglove-bridge --map museum --origin http://viewer:8080   a Lichtblick of your own
  foxglove-bridge --listen 0.0.0.0:8765 --certificate own.pem --key own.key --authority ca.pem

Exit code 0: it was asked to end, by Ctrl-C or SIGTERM; 1: it failed, and said why; 2: wrong usage
or bad input, such as a map that the server does not have."
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
    #[command(flatten)]
    pub(crate) bridge: BridgeArgs,
}

#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Writes completions for a shell to standard output.
    Completions(CompletionsArgs),
}

#[derive(Debug, clap::Args)]
pub(crate) struct BridgeArgs {
    #[command(flatten)]
    pub(crate) server: ConnectArgs,
    /// The map.
    #[arg(long, value_name = "NAME", default_value = "museum")]
    pub(crate) map: MapName,
    /// Where viewers connect. An address that other machines reach needs certificates.
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8765", value_parser = fht_program::flags::socket_address)]
    pub(crate) listen: SocketAddr,
    /// A page that may connect besides Foxglove's own and those of this machine, such as
    /// http://viewer:8080 (repeatable).
    #[arg(long, value_name = "URL", value_parser = origin)]
    pub(crate) origin: Vec<String>,
    /// A name by which the bridge is reached, besides those in its certificate (repeatable).
    #[arg(long, value_name = "HOST")]
    pub(crate) name: Vec<String>,
    /// So many viewers at a time.
    #[arg(long, value_name = "NUMBER", default_value = "16", value_parser = fht_program::flags::how_many)]
    pub(crate) max_viewers: usize,
    /// The bridge's certificate (PEM). Who comes shows one, too: its common name is ROLE:NAME.
    #[arg(long, value_name = "FILE", requires_all = ["key", "authority"])]
    certificate: Option<PathBuf>,
    /// The certificate's key (PEM).
    #[arg(long, value_name = "FILE", requires = "certificate")]
    key: Option<PathBuf>,
    /// Who has signed the certificates of those who are let in (PEM).
    #[arg(long, value_name = "FILE", requires = "certificate")]
    authority: Option<PathBuf>,
    /// Write everything that is shown to this file (MCAP), whether anybody looks or not.
    #[arg(long, value_name = "FILE", value_parser = new_file)]
    pub(crate) record: Option<PathBuf>,
}

impl BridgeArgs {
    /// The files; clap has seen to it that all are there or none.
    pub(crate) fn certificates(&self) -> Option<DoorCertificates> {
        let (certificate, key, authority) = (self.certificate.clone()?, self.key.clone()?, self.authority.clone()?);
        Some(DoorCertificates { certificate, key, authority })
    }
}

/// A page's origin as browsers write it: without a path, in small letters, and without the port
/// that its scheme has anyway.
fn origin(text: &str) -> Result<String, String> {
    let none = || format!("'{text}' is no origin of a page, such as http://viewer:8080");
    let url: Uri = text.parse().map_err(|_| none())?;
    let (Some(scheme), Some(host)) = (url.scheme_str(), url.host().filter(|host| !host.is_empty())) else {
        return Err(none());
    };
    if url.path_and_query().is_some_and(|path| path != "/") {
        return Err(format!(
            "'{text}' is a page, and its origin has no path: {scheme}://{}",
            url.authority().map_or(host, Authority::as_str)
        ));
    }
    let usual = match scheme {
        "http" => Some(80),
        "https" => Some(443),
        _ => None,
    };
    let port = url.port_u16().filter(|port| Some(*port) != usual).map(|port| format!(":{port}")).unwrap_or_default();
    Ok(format!("{scheme}://{host}{port}").to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_as_browsers_write_them() {
        for (given, expected) in [
            ("http://viewer:8080", "http://viewer:8080"),
            ("http://viewer:8080/", "http://viewer:8080"),
            ("HTTP://Other:80", "http://other"),
            ("https://other:443/", "https://other"),
            ("https://[::1]:8443", "https://[::1]:8443"),
            ("tauri://localhost", "tauri://localhost"),
        ] {
            assert_eq!(origin(given).as_deref(), Ok(expected), "{given}");
        }
        for none in ["nonsense", "", "viewer:8080", "http://viewer/page", "http://viewer?x=1", "*", "http://"] {
            assert!(origin(none).is_err(), "{none}");
        }
    }
}
